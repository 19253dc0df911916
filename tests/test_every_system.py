"""Portability: all modules import, and a folder is locked, without the modules of POSIX."""

import ast
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(path for room in ("toolkit", "database_builder") for path in (ROOT / room).rglob("*.py"))

WITHOUT_POSIX = """
import builtins, importlib, pkgutil, sys
hidden = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog"}
real = builtins.__import__
def on_windows(name, globals=None, locals=None, fromlist=(), level=0):
    asking = (globals or {}).get("__name__", "").split(".")[0]
    if name in hidden and asking in {"toolkit", "database_builder", "filelock", "platformdirs"}:
        raise ModuleNotFoundError(f"No module named {name!r}")
    return real(name, globals, locals, fromlist, level)
builtins.__import__ = on_windows
import toolkit, database_builder
for package in (toolkit, database_builder):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
from toolkit.io.files import locked
with locked(sys.argv[1]):
    print("imported and locked")
"""

POSIX_ONLY = {
    "os": set(
        "O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK WNOHANG chown chroot ctermid fchmod fchown fork forkpty "
        "getegid geteuid getgid getgroups getloadavg getpgid getpgrp getpriority getresuid getsid getuid killpg lchown "
        "major mkfifo mknod nice openpty pathconf posix_fadvise posix_spawn pread preadv pwrite sched_getaffinity "
        "sched_setaffinity sendfile setpgid setpriority setsid statvfs sync sysconf uname wait wait3 wait4".split()
    ),
    "signal": set(
        "SIGALRM SIGBUS SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIGWINCH alarm "
        "pause pthread_kill pthread_sigmask setitimer sigwait".split()
    ),
}


def test_everything_is_imported_and_a_folder_locked_without_the_modules_of_posix(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX, str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.stdout == "imported and locked\n", done.stderr


def test_posix_only_features_are_checked_before_use() -> None:
    unasked = []
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            match node:
                case ast.Attribute(value=ast.Name(id=module), attr=name) if name in POSIX_ONLY.get(module, ()):
                    if f'hasattr({module}, "{name}")' not in text:
                        unasked.append(f"{path.relative_to(ROOT)}:{node.lineno}: {module}.{name}")
    assert not unasked
