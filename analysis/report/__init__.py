"""The report: one self-contained HTML page, figures in it as SVG and beside it as PDF.

`write_report` is what people call; `figures` draws, `photos` lays lines over
photographs, `budget` (one package up) says what the tip's error is made of.
"""

from __future__ import annotations

from .build import ReportFiles, write_report

__all__ = ["ReportFiles", "write_report"]
