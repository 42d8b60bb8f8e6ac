"""The virtual bench: rig, simulator and vision in one."""
