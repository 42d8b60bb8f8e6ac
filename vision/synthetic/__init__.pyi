from .frames import (
    CLEAN as CLEAN,
)
from .frames import (
    HARD as HARD,
)
from .frames import (
    LIGHTS as LIGHTS,
)
from .frames import (
    SHAPES as SHAPES,
)
from .frames import (
    STANDARD as STANDARD,
)
from .frames import (
    Frame as Frame,
)
from .frames import (
    Light as Light,
)
from .frames import (
    Truth as Truth,
)
from .frames import (
    curve as curve,
)
from .frames import (
    draw as draw,
)
from .frames import (
    frames as frames,
)
from .scene import (
    Block as Block,
)
from .scene import (
    Scene as Scene,
)
from .scene import (
    SceneLight as SceneLight,
)
from .scene import (
    render_board as render_board,
)
from .scene import (
    render_scene as render_scene,
)
from .scene import (
    scene_camera as scene_camera,
)
from .score import (
    Score as Score,
)
from .score import (
    arc_length as arc_length,
)
from .score import (
    score as score,
)
from .score import (
    signed_distance as signed_distance,
)
