from .bench.config import (
    BenchModel as BenchModel,
)
from .bench.config import (
    Plan as Plan,
)
from .bench.config import (
    RigModel as RigModel,
)
from .bench.config import (
    read_plan as read_plan,
)
from .bench.config import (
    read_rig as read_rig,
)
from .bench.devices import (
    Devices as Devices,
)
from .bench.devices import (
    closing_all as closing_all,
)
from .bench.measured import (
    keep_measured_gap as keep_measured_gap,
)
from .bench.measured import (
    why_doubt_gap as why_doubt_gap,
)
from .bench.open import (
    open_camera as open_camera,
)
from .bench.open import (
    open_devices as open_devices,
)
from .bench.open import (
    open_meter as open_meter,
)
from .bench.open import (
    open_stage as open_stage,
)
from .bench.template import (
    is_bench as is_bench,
)
from .bench.template import (
    write_templates as write_templates,
)
from .camera.capture import (
    Source as Source,
)
from .camera.config import (
    CameraConfig as CameraConfig,
)
from .camera.live_view import (
    LiveStatus as LiveStatus,
)
from .camera.live_view import (
    Watched as Watched,
)
from .camera.live_view import (
    live_view as live_view,
)
from .camera.photo_flags import (
    photo_flags as photo_flags,
)
from .camera.protocol import (
    Image as Image,
)
from .camera.protocol import (
    brightness as brightness,
)
from .camera.protocol import (
    encode_png as encode_png,
)
from .camera.protocol import (
    grab_median as grab_median,
)
from .camera.protocol import (
    sharpness as sharpness,
)
from .clock import (
    Check as Check,
)
from .clock import (
    Clock as Clock,
)
from .clock import (
    ScaledClock as ScaledClock,
)
from .clock import (
    SteppedClock as SteppedClock,
)
from .clock import (
    SystemClock as SystemClock,
)
from .clock import (
    go_on as go_on,
)
from .control.client import NobodyError as NobodyError
from .control.client import ask as ask
from .control.client import watch as watch
from .control.owner import Owner as Owner
from .control.owner import owning as owning
from .control.state import BenchState as BenchState
from .errors import AlarmError as AlarmError
from .errors import InterlockError as InterlockError
from .errors import LinkLostError as LinkLostError
from .errors import NotStoppedError as NotStoppedError
from .errors import PositionLostError as PositionLostError
from .errors import StageTimeoutError as StageTimeoutError
from .errors import StoppedError as StoppedError
from .interrupts import (
    heed_interrupts as heed_interrupts,
)
from .link import (
    Link as Link,
)
from .meter.config import (
    MeterConfig as MeterConfig,
)
from .meter.description import (
    ready_meters as ready_meters,
)
from .meter.protocol import (
    Flux as Flux,
)
from .meter.protocol import (
    Meter as Meter,
)
from .meter.protocol import (
    Sample as Sample,
)
from .meter.protocol import (
    combine as combine,
)
from .ports import (
    PortInfo as PortInfo,
)
from .ports import (
    list_ports as list_ports,
)
from .ports import (
    resolve_port as resolve_port,
)
from .runs.amend import (
    amend_flux as amend_flux,
)
from .runs.control import RunControl as RunControl
from .runs.documents import (
    documents_of as documents_of,
)
from .runs.documents import (
    write_documents as write_documents,
)
from .runs.dry_run import (
    homing_s as homing_s,
)
from .runs.dry_run import (
    plan_steps as plan_steps,
)
from .runs.folder import (
    RunFolder as RunFolder,
)
from .runs.migrate import migrate_run as migrate_run
from .runs.nexus import (
    write_nexus as write_nexus,
)
from .runs.read import (
    Run as Run,
)
from .runs.read import (
    is_run as is_run,
)
from .runs.read import (
    read_run as read_run,
)
from .runs.records import (
    SCHEMA as SCHEMA,
)
from .runs.records import (
    sha256_of as sha256_of,
)
from .runs.records import (
    utc_now as utc_now,
)
from .runs.runner import (
    RunSummary as RunSummary,
)
from .runs.runner import (
    run as run,
)
from .runs.scan_field import (
    FieldScan as FieldScan,
)
from .runs.scan_field import (
    scan_field as scan_field,
)
from .runs.verify import (
    RunCheck as RunCheck,
)
from .runs.verify import (
    check_run as check_run,
)
from .runs.verify import (
    check_used as check_used,
)
from .runs.verify import (
    verify_run as verify_run,
)
from .runs.witness import (
    FieldDoubt as FieldDoubt,
)
from .runs.witness import (
    Reading as Reading,
)
from .stage.config import (
    LimitsConfig as LimitsConfig,
)
from .stage.config import (
    StageConfig as StageConfig,
)
from .stage.gap import (
    NEVER_MEASURED as NEVER_MEASURED,
)
from .stage.gap import (
    GapStage as GapStage,
)
from .stage.gap_records import (
    GapStatus as GapStatus,
)
from .stage.gap_records import (
    MoveRecord as MoveRecord,
)
from .stage.grbl.protocol import STOP_INPUTS as STOP_INPUTS
from .stage.grbl.stage import (
    GrblStage as GrblStage,
)
from .stage.make import (
    make_stage as make_stage,
)
from .stage.marlin.stage import (
    MarlinStage as MarlinStage,
)
from .stage.polled import (
    Answer as Answer,
)
from .stage.polled import (
    PolledStage as PolledStage,
)
from .stage.protocol import (
    Stage as Stage,
)
from .stage.protocol import (
    StageIdentity as StageIdentity,
)
from .stage.protocol import (
    StageLimits as StageLimits,
)
from .stage.stop_request import (
    stop_from_outside as stop_from_outside,
)
from .stage.stop_request import stopping as stopping
from .wire_log import WireLog as WireLog
