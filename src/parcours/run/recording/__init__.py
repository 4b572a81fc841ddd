"""Records runs in files that foreign tools read (MCAP, ROS 1 bag) while they happen, and reads them back as traces."""

from parcours.run.recording.layout import Entry, PayloadCodec
from parcours.run.recording.recorder import Recorder, write_recording
from parcours.run.recording.recording_file import Recording, convert, read_recording
from parcours.run.recording.topic import Raw

__all__ = ["Entry", "PayloadCodec", "Raw", "Recorder", "Recording", "convert", "read_recording", "write_recording"]
