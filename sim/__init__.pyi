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
from .batch.tips import (
    solve_many as solve_many,
)
from .check.solver import (
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
    read_readings as read_readings,
)
from .one_rod import (
    solve as solve,
)
from .path.follow import (
    Path as Path,
)
from .path.follow import (
    PathFold as PathFold,
)
from .path.follow import (
    PathPoint as PathPoint,
)
from .path.follow import (
    follow_path as follow_path,
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
    read_field as read_field,
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
from .study.sweep import (
    sweep as sweep,
)
from .table1 import (
    gmc as gmc,
)
