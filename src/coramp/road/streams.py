"""The two streams of vehicles."""

STREAMS = ("mainline", "ramp")
"""Names of the streams; a stream's place is also whether it comes by the ramp."""
