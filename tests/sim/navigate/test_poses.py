"""Fields that move with the insertion."""

from __future__ import annotations

import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.sim import Dipole, Field, MagnetField, Uniform, UniformField, gmc
from magbend.sim.navigate import channel, moving, navigate

CUBE = MagnetField(magnet=Magnet.cube(55.0, 1.3), gap_mm=90.0)


def test_poses_move_a_magnet_that_has_a_gap_already():
    near, far = ({"insertion_mm": at, "gap_mm": at + 40.0} for at in (10.0, 20.0))
    moved = moving(CUBE, [near, far])
    assert moved(15.0).sources[0].gap_mm == pytest.approx(55.0)
    assert moved(0.0).sources[0].gap_mm == pytest.approx(50.0)


def test_poses_lead_a_field_out_of_the_plane():
    pose = {"insertion_mm": 0.0, "flux_mT": 10.0, "elevation_deg": 0.0}
    up = pose | {"insertion_mm": 10.0, "elevation_deg": 60.0}
    assert moving(None, [pose, up])(5.0) == Field(
        Uniform(flux_mT=10.0, angle_deg=90.0, elevation_deg=30.0)
    )
    flat = {"insertion_mm": 0.0, "gap_mm": 50.0, "elevation_deg": 15.0}
    assert moving(CUBE, [flat])(0.0).sources[0].elevation_deg == 15.0


def test_poses_that_lead_out_of_a_planar_lumen_are_refused_on_the_way():
    pose = {"insertion_mm": 0.0, "flux_mT": 10.0, "elevation_deg": 0.0}
    up = pose | {"insertion_mm": 10.0, "elevation_deg": 60.0}
    slit = channel("slit", width_mm=3.0, legs=[(20.0, 0.0)])
    with pytest.raises(InputError, match="must be within its plane"):
        navigate(gmc(2), slit, moving(None, [pose, up]), way_mm=5.0, step_mm=2.0)


def test_what_poses_leave_out_stays_that_of_the_field():
    pose = {"insertion_mm": 0.0, "flux_mT": 10.0}
    assert moving(None, [pose])(3.0) == UniformField(flux_mT=10.0)
    oblique = Field(Uniform(flux_mT=1.0, angle_deg=40.0, elevation_deg=20.0))
    assert moving(oblique, [pose])(3.0) == Field(
        Uniform(flux_mT=10.0, angle_deg=40.0, elevation_deg=20.0)
    )


def test_a_gap_that_no_source_has_is_refused():
    fixed = Field(Dipole(moment_A_m2=1.0, centre_mm=(0.0, 80.0, 0.0)))
    with pytest.raises(InputError, match="must move a source that stands at a gap"):
        moving(fixed, [{"insertion_mm": 0.0, "gap_mm": 50.0}])
