"""Runs as recordings that foreign tools read (MCAP, ROS 1 bag), written while they happen, and read back as traces."""

from parcours.run.recording.layout import Codec, Entry, FieldForm
from parcours.run.recording.recorder import Recorder, write_bag, write_mcap
from parcours.run.recording.recording_file import Recording, convert, read_recording
from parcours.run.recording.topic import Raw

__all__ = [
    "Codec",
    "Entry",
    "FieldForm",
    "Raw",
    "Recorder",
    "Recording",
    "convert",
    "read_recording",
    "write_bag",
    "write_mcap",
]
