from .fields import (
    direction as direction,
)
from .fields import (
    field_array as field_array,
)
from .fields import (
    field_rows as field_rows,
)
from .fields import (
    template as template,
)
from .fields import (
    uniform_rows as uniform_rows,
)
from .overlap import (
    may_meet as may_meet,
)
from .overlap import (
    refuse_overlap as refuse_overlap,
)
from .rods import (
    MOST_POINTS as MOST_POINTS,
)
from .rods import (
    array_cache as array_cache,
)
from .rods import (
    checked_density as checked_density,
)
from .rods import (
    loads_per_unit as loads_per_unit,
)
from .rods import (
    many_rods as many_rods,
)
from .rods import (
    rod_array as rod_array,
)
from .rods import (
    stations as stations,
)
from .rods import (
    stiffness_Nmm2 as stiffness_Nmm2,
)
