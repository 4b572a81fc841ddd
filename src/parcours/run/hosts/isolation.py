"""Moves a process into a network of its own, where only loopback exists and every port is free.

ROS nodes written in C++ always listen on all interfaces, and two graphs on one machine dispute one
port. In a network namespace of its own a graph is out of reach and alone. As a command, `python -m
parcours.run.hosts.isolation COMMAND ARGUMENT...` runs any command there.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import socket
import struct
import sys
import threading
from pathlib import Path
from typing import NoReturn

from parcours.errors import HostFailure

_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000  # clone(2)
_ALONE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
"""What ROS 2 is told there: loopback is all there is, and shared memory would be shared with other networks."""

_SET_FLAGS = 0x8914  # SIOCSIFFLAGS, netdevice(7)
_UP_AND_RUNNING = 0x1 | 0x40


def enter_own_network() -> None:
    """Move this process, and with it its later children, into a new network namespace whose loopback is up.

    Sockets that are already open stay where they are. A user other than root gets a user namespace around it, which the
    operating system grants only to a process of one thread: call this before threads exist, then also before numpy is
    imported (its linear algebra starts some). User and group keep their numbers. Raises HostFailure if there are other
    threads, or the machine forbids namespaces.
    """
    if threading.active_count() > 1:
        others = ", ".join(thread.name for thread in threading.enumerate() if thread is not threading.current_thread())
        _refuse(f"must be entered before threads exist, but there are also {others}", "call enter_own_network first")
    failed = _unshare(_NEW_NETWORK)
    if failed == errno.EPERM:
        user, group = os.geteuid(), os.getegid()
        failed = _unshare(_NEW_USER | _NEW_NETWORK)
        if not failed:
            _keep_numbers(user, group)
    if failed == errno.EINVAL:
        rule = f"may be entered without root by a process of one thread only, but this one has {_threads()}"
        _refuse(rule, "call enter_own_network before importing numpy, or run as root")
    if failed:
        rule = f"must be allowed by the machine, but unshare failed: {os.strerror(failed)}"
        remedy = (
            "run as root; in a container add the capability SYS_ADMIN; "
            "or let the administrator allow unprivileged user namespaces (sysctl -a | grep userns)"
        )
        _refuse(rule, remedy)
    _raise_loopback()
    os.environ.update(_ALONE)


def _unshare(flags: int) -> int:
    """Return 0, or the number of the error."""
    library = ctypes.CDLL(None, use_errno=True)
    try:
        return 0 if library.unshare(flags) == 0 else ctypes.get_errno()
    except AttributeError:  # not Linux
        return errno.ENOSYS


def _keep_numbers(user: int, group: int) -> None:
    mine = Path("/proc/self")
    try:
        (mine / "setgroups").write_text("deny")
        (mine / "uid_map").write_text(f"{user} {user} 1")
        (mine / "gid_map").write_text(f"{group} {group} 1")
    except OSError as error:
        _refuse(f"must let users keep their numbers, but {error.filename}: {error.strerror}", "run as root")


def _threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def _raise_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        try:
            fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sH22x", b"lo", _UP_AND_RUNNING))
        except OSError as error:
            _refuse(f"must have a loopback, but it cannot be brought up: {error.strerror}", "run as root")


def _refuse(rule: str, remedy: str) -> NoReturn:
    raise HostFailure("a network of its own", rule, remedy, slug="network-namespace")


def main(command: list[str]) -> int:
    """Become `command` in a network of its own; return only if that cannot be, with 125 as env(1) and timeout(1) do."""
    try:
        if not command:
            _refuse(
                "is for a command, but none was given", "python -m parcours.run.hosts.isolation COMMAND ARGUMENT..."
            )
        enter_own_network()
        os.execvp(command[0], command)
    except OSError as error:
        sys.stderr.write(f"{command[0]}: {error.strerror}\n")
    except HostFailure as error:
        sys.stderr.write(f"{error}\n")
    return 125


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
