from . import (
    navigate as navigate,
)
from .batch.shapes import (
    ROWS_PER_CALL as ROWS_PER_CALL,
)
from .batch.shapes import (
    STATUS as STATUS,
)
from .batch.shapes import (
    Designs as Designs,
)
from .batch.shapes import (
    Shapes as Shapes,
)
from .batch.shapes import (
    designs_of as designs_of,
)
from .batch.shapes import (
    solve_shapes as solve_shapes,
)
from .batch.space import (
    solve_spatial_many as solve_spatial_many,
)
from .batch.threads import (
    cores as cores,
)
from .batch.threads import (
    in_threads as in_threads,
)
from .batch.tips import (
    solve_many as solve_many,
)
from .check.against import (
    verify as verify,
)
from .equilibria.find import (
    find_equilibria as find_equilibria,
)
from .fields import (
    PULLED_IN as PULLED_IN,
)
from .fields import (
    STABLE as STABLE,
)
from .fields import (
    UNSTABLE as UNSTABLE,
)
from .fields import (
    Field as Field,
)
from .fields import (
    MagnetField as MagnetField,
)
from .fields import (
    Support as Support,
)
from .fields import (
    UniformField as UniformField,
)
from .fields import (
    before as before,
)
from .fields import (
    kinds_of as kinds_of,
)
from .magnet.field import (
    magnet_flux_mT as magnet_flux_mT,
)
from .magnet.field import (
    magnet_gradient_mT_per_mm as magnet_gradient_mT_per_mm,
)
from .magnet.fit import (
    MagnetFit as MagnetFit,
)
from .magnet.fit import (
    ReadingVerdict as ReadingVerdict,
)
from .magnet.fit import (
    axis_flux_by_integral_mT as axis_flux_by_integral_mT,
)
from .magnet.fit import (
    axis_share as axis_share,
)
from .magnet.fit import (
    fit_magnet as fit_magnet,
)
from .magnet.map import (
    FieldMap as FieldMap,
)
from .magnet.map import (
    read_map as read_map,
)
from .magnet.map import (
    sampled_map as sampled_map,
)
from .magnet.readings import (
    paper_readings as paper_readings,
)
from .magnet.readings import (
    read_readings as read_readings,
)
from .one_rod import (
    solve as solve,
)
from .path.draw import (
    animate_path as animate_path,
)
from .path.draw import (
    draw_path as draw_path,
)
from .path.draw import (
    draw_pull_in as draw_pull_in,
)
from .path.draw import (
    path_csv as path_csv,
)
from .path.draw import (
    pull_in_csv as pull_in_csv,
)
from .path.follow import (
    follow_path as follow_path,
)
from .path.pull_in import (
    PullIn as PullIn,
)
from .path.pull_in import (
    pull_in_gaps as pull_in_gaps,
)
from .path.records import (
    Path as Path,
)
from .path.records import (
    PathFold as PathFold,
)
from .path.records import (
    PathPoint as PathPoint,
)
from .planar.march import (
    march as march,
)
from .probe import (
    flux_mT as flux_mT,
)
from .rods import (
    Rod as Rod,
)
from .rods import (
    Section as Section,
)
from .rods import (
    profile_sections as profile_sections,
)
from .sensitivity.derivatives import (
    Sensitivities as Sensitivities,
)
from .sensitivity.derivatives import (
    sensitivities as sensitivities,
)
from .solution import (
    Ending as Ending,
)
from .solution import (
    Solution as Solution,
)
from .sources import (
    Coil as Coil,
)
from .sources import (
    Cuboid as Cuboid,
)
from .sources import (
    Cylinder as Cylinder,
)
from .sources import (
    Dipole as Dipole,
)
from .sources import (
    Gradient as Gradient,
)
from .sources import (
    Uniform as Uniform,
)
from .sources import (
    field_of_tables as field_of_tables,
)
from .sources import (
    read_field as read_field,
)
from .sources import (
    tables_of as tables_of,
)
from .spatial.rod import (
    SpatialRod as SpatialRod,
)
from .spatial.rod import (
    SpatialSection as SpatialSection,
)
from .spatial.solver import (
    SpatialSolution as SpatialSolution,
)
from .spatial.solver import (
    solve_spatial as solve_spatial,
)
from .study.equilibria_figure import (
    draw_equilibria as draw_equilibria,
)
from .study.figures import (
    draw_field_map as draw_field_map,
)
from .study.figures import (
    draw_study as draw_study,
)
from .study.sweep import (
    STUDIES as STUDIES,
)
from .study.sweep import (
    sweep as sweep,
)
from .study.sweep import (
    sweep_csv as sweep_csv,
)
from .table1 import (
    gmc as gmc,
)
from .vibration import (
    Mode as Mode,
)
from .vibration import (
    first_mode as first_mode,
)
