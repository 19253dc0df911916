"""Checks before Open3D draws: it ends the process where Vulkan or the display is missing."""

from __future__ import annotations

import ctypes
import os
import sys

VULKAN_PACKAGES = "on Debian or Ubuntu `apt-get install libvulkan1 mesa-vulkan-drivers`"


class _InstanceInfo(ctypes.Structure):
    """VkInstanceCreateInfo of the Vulkan specification."""

    _fields_ = [
        ("type", ctypes.c_int), ("next", ctypes.c_void_p), ("flags", ctypes.c_uint32), ("application", ctypes.c_void_p),
        ("layers", ctypes.c_uint32), ("layer_names", ctypes.c_void_p),
        ("extensions", ctypes.c_uint32), ("extension_names", ctypes.c_void_p),
    ]  # fmt: skip


def obstacle_to_drawing() -> str | None:
    """Return the reason for which Open3D cannot draw here, a clause, or None."""
    if not sys.platform.startswith("linux") or _vulkan_devices():
        return None
    return f"Vulkan finds no device; install a driver ({VULKAN_PACKAGES})"


def obstacle_to_window() -> str | None:
    """Return the reason for which Open3D cannot open a window here, a clause, or None."""
    if not sys.platform.startswith("linux"):
        return None
    if not (os.environ.get("WAYLAND_DISPLAY") or has_x_display()):
        return "there is no display; work at the machine's own screen, or through `ssh -X` or `xvfb-run` (package xvfb)"
    return obstacle_to_drawing()


def _vulkan_devices() -> int:
    """Number of devices that Vulkan finds, software renderers included; 0 without the library."""
    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return 0
    instance, count = ctypes.c_void_p(), ctypes.c_uint32()
    create_info = 1  # VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO of the Vulkan specification
    info = _InstanceInfo(type=create_info)
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)):
        return 0
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    vulkan.vkDestroyInstance(instance, None)
    return count.value


def has_x_display() -> bool:
    """Return True where an X server answers at `DISPLAY`."""
    if not os.environ.get("DISPLAY"):
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return False
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return True
