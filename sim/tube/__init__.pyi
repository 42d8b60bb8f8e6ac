from .tube import Ring as Ring
from .tube import Tube as Tube
from .tube import helix as helix
