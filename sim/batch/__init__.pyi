from .shapes import (
    ROWS_PER_CALL as ROWS_PER_CALL,
)
from .shapes import (
    STATUS as STATUS,
)
from .shapes import (
    Designs as Designs,
)
from .shapes import (
    Shapes as Shapes,
)
from .shapes import (
    designs_of as designs_of,
)
from .shapes import (
    solve_shapes as solve_shapes,
)
from .space import (
    solve_spatial_many as solve_spatial_many,
)
from .threads import (
    cores as cores,
)
from .threads import (
    in_threads as in_threads,
)
from .tips import (
    OUTCOMES as OUTCOMES,
)
from .tips import (
    solve_many as solve_many,
)
