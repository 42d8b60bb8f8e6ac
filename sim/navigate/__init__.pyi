from .channels import channel as channel
from .curves import Arc as Arc
from .curves import circle as circle
from .curves import (
    outline as outline,
)
from .curves import polyline as polyline
from .curves import spline as spline
from .figures import draw_passage as draw_passage
from .figures import film as film
from .files import lumen_of as lumen_of
from .files import read_lumen as read_lumen
from .files import read_poses as read_poses
from .in_plane import crosses as crosses
from .in_tube import SpatialContact as SpatialContact
from .in_tube import SpatialPassage as SpatialPassage
from .in_tube import SpatialStep as SpatialStep
from .lumen import Gate as Gate
from .lumen import Lumen as Lumen
from .lumen import Wall as Wall
from .many import navigate_many as navigate_many
from .passage import Branch as Branch
from .passage import Contact as Contact
from .passage import Event as Event
from .passage import Passage as Passage
from .passage import Step as Step
from .poses import moving as moving
from .solver import navigate as navigate
from .steering import Reach as Reach
from .steering import Steered as Steered
from .steering import plan_of as plan_of
from .steering import poses_text as poses_text
from .steering import steer as steer
