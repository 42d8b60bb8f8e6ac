from .solver import (
    CheckSolution as CheckSolution,
)
from .solver import (
    check_solve as check_solve,
)
from .solver import (
    verify as verify,
)
