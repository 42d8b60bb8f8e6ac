from .batch.overlay import (
    draw_overlay as draw_overlay,
)
from .batch.run import (
    BatchResult as BatchResult,
)
from .batch.run import (
    Settings as Settings,
)
from .batch.run import (
    extract_files as extract_files,
)
from .batch.run import (
    measure as measure,
)
from .batch.tables import (
    read_centrelines as read_centrelines,
)
from .batch.tables import (
    read_frames as read_frames,
)
from .camera.board import (
    Board as Board,
)
from .camera.board_print import (
    write_board as write_board,
)
from .camera.calibrate import (
    calibrate as calibrate,
)
from .camera.calibrate import (
    calibrate_known_length as calibrate_known_length,
)
from .camera.calibration import (
    Calibration as Calibration,
)
from .camera.calibration import (
    scale_calibration as scale_calibration,
)
from .camera.calibration import (
    specimen_to_px as specimen_to_px,
)
from .extraction.extract import (
    extract as extract,
)
from .measurement import (
    Measurement as Measurement,
)
from .measurement import (
    Pose as Pose,
)
from .picture.photo import (
    Photo as Photo,
)
from .picture.photo import (
    as_photo as as_photo,
)
from .picture.photo import (
    read_photo as read_photo,
)
from .synthetic.score import (
    Score as Score,
)
from .synthetic.score import (
    score as score,
)
