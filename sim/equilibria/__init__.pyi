from .find import (
    find_equilibria as find_equilibria,
)
from .folds import (
    Branch as Branch,
)
from .folds import (
    Fold as Fold,
)
from .folds import (
    find_folds as find_folds,
)
from .folds import (
    trace_branches as trace_branches,
)
from .uniform import (
    Equilibrium as Equilibrium,
)
