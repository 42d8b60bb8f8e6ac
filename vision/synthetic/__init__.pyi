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
from .parts import (
    BLACK as BLACK,
)
from .parts import (
    BLUE as BLUE,
)
from .parts import (
    GREY as GREY,
)
from .parts import (
    PAPER as PAPER,
)
from .parts import (
    RUBBER as RUBBER,
)
from .parts import (
    Block as Block,
)
from .parts import (
    Mark as Mark,
)
from .parts import (
    Rod as Rod,
)
from .parts import (
    Scene as Scene,
)
from .parts import (
    SceneLight as SceneLight,
)
from .parts import (
    scene_camera as scene_camera,
)
from .scene import (
    expose as expose,
)
from .scene import (
    paint_scene as paint_scene,
)
from .scene import (
    render_board as render_board,
)
from .scene import (
    render_scene as render_scene,
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
