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
from .tips import (
    OUTCOMES as OUTCOMES,
)
from .tips import (
    solve_many as solve_many,
)
