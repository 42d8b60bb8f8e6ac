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
    Label as Label,
)
from .parts import (
    Mark as Mark,
)
from .parts import (
    Ridge as Ridge,
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
from .scoring import (
    Score as Score,
)
from .scoring import (
    arc_length as arc_length,
)
from .scoring import (
    score as score,
)
from .scoring import (
    signed_distance as signed_distance,
)
from .square_view import (
    CLEAN as CLEAN,
)
from .square_view import (
    HARD as HARD,
)
from .square_view import (
    LIGHTS as LIGHTS,
)
from .square_view import (
    SHAPES as SHAPES,
)
from .square_view import (
    STANDARD as STANDARD,
)
from .square_view import (
    Frame as Frame,
)
from .square_view import (
    Light as Light,
)
from .square_view import (
    Truth as Truth,
)
from .square_view import (
    curve as curve,
)
from .square_view import (
    draw as draw,
)
from .square_view import (
    frames as frames,
)
