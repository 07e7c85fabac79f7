"""How one vehicle may move: to the speed of its lane, to a stop, behind a slower one."""
