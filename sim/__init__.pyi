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
    Solution as Solution,
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
from .one_rod import (
    solve as solve,
)
from .sensitivity.derivatives import (
    Sensitivities as Sensitivities,
)
from .sensitivity.derivatives import (
    sensitivities as sensitivities,
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
