"""Small files of every kind that a person can attach, as their programs would write them."""

from __future__ import annotations

import struct
import zlib

__all__ = ["CSV", "JPEG", "PDF", "PNG", "STEP", "TEXT", "WHOLE", "png"]


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(width: int = 8, height: int = 8, grey: int = 128) -> bytes:
    """Return a grey picture."""
    rows = (b"\0" + bytes([grey]) * width) * height
    header = _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + _chunk(b"IDAT", zlib.compress(rows)) + _chunk(b"IEND", b"")


def _segment(mark: int, data: bytes) -> bytes:
    return bytes((0xFF, mark)) + struct.pack(">H", len(data) + 2) + data


PNG = png()
JPEG = (
    b"\xff\xd8"
    + _segment(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0")
    + _segment(0xC0, struct.pack(">BHHB", 8, 4, 4, 1) + b"\1\x11\0")
    + _segment(0xDA, b"\1\1\0\0\x3f\0")
    + b"\x12\x34\xff\xd9"
)
PDF = b"%PDF-1.4\n1 0 obj\n<< /Type /Catalog >>\nendobj\ntrailer\n<< /Root 1 0 R >>\n%%EOF\n"
STEP = b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
CSV = b"voltage,current\n0.0,1.2\n"
TEXT = "The cell measures 40 mm \u00d7 80 mm.\n".encode()

WHOLE = {
    "photo.png": ("png", PNG),
    "photo.JPG": ("jpeg", JPEG),
    "certificate.pdf": ("pdf", PDF),
    "cell.stp": ("step", STEP),
    "curve.csv": ("csv", CSV),
    "notes.txt": ("text", TEXT),
}
"""Name of a file to its kind and content."""
