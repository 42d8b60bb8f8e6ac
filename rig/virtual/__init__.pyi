from .axis import VirtualAxis as VirtualAxis
from .bench import (
    open_twin as open_twin,
)
from .board.file import (
    load_board as load_board,
)
from .board.file import (
    save_board as save_board,
)
from .pty_server import (
    PtyBoard as PtyBoard,
)
