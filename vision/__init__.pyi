from .batch.figures import (
    figure_kind as figure_kind,
)
from .batch.figures import (
    figure_of_steps as figure_of_steps,
)
from .batch.film import (
    ring_of_film as ring_of_film,
)
from .batch.inputs import (
    list_sources as list_sources,
)
from .batch.inputs import (
    read_source as read_source,
)
from .batch.overlay import (
    draw_overlay as draw_overlay,
)
from .batch.rescue import (
    rescue as rescue,
)
from .batch.run import (
    BatchResult as BatchResult,
)
from .batch.run import (
    extract_files as extract_files,
)
from .batch.run import (
    is_made_by_us as is_made_by_us,
)
from .batch.tables import (
    Done as Done,
)
from .batch.tables import (
    FrameRow as FrameRow,
)
from .batch.tables import (
    read_centrelines as read_centrelines,
)
from .batch.tables import (
    read_edges as read_edges,
)
from .batch.tables import (
    read_frames as read_frames,
)
from .batch.tables import (
    write_centrelines as write_centrelines,
)
from .batch.tables import (
    write_frames as write_frames,
)
from .batch.tag_place import (
    TagPlace as TagPlace,
)
from .batch.tag_place import (
    tag_place as tag_place,
)
from .camera.board import (
    Board as Board,
)
from .camera.board import (
    find_corners as find_corners,
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
from .camera.calibration_file import (
    read_calibration as read_calibration,
)
from .camera.calibration_file import (
    write_calibration as write_calibration,
)
from .camera.clamp_tag import (
    ClampTag as ClampTag,
)
from .camera.clamp_tag import (
    tag_number as tag_number,
)
from .camera.find_tag import (
    find_tag as find_tag,
)
from .camera.oriented import (
    oriented as oriented,
)
from .extraction.bare import (
    read_bare as read_bare,
)
from .extraction.extract import (
    extract as extract,
)
from .extraction.extract import (
    measure as measure,
)
from .extraction.follow import (
    follow as follow,
)
from .extraction.hints import (
    Hints as Hints,
)
from .extraction.hints import (
    measure_hinted as measure_hinted,
)
from .extraction.outline import (
    Placed as Placed,
)
from .extraction.outline import (
    place_outline as place_outline,
)
from .extraction.ring import (
    Ringing as Ringing,
)
from .extraction.ring import (
    ring_down as ring_down,
)
from .extraction.setting import (
    Setting as Setting,
)
from .extraction.setting import (
    with_specimen as with_specimen,
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
from .picture.srgb import (
    encode_srgb as encode_srgb,
)
from .synthetic.scoring import (
    Score as Score,
)
from .synthetic.scoring import (
    score as score,
)
