# SPDX-License-Identifier: Apache-2.0
"""Options of the commands that show a page in the browser."""

from __future__ import annotations

import argparse


def add_page(parser: argparse.ArgumentParser) -> None:
    """Adds the address of the page, and ``--no-open``."""
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        help="Address to listen at; by default 127.0.0.1, this computer only. With 0.0.0.0, every person on the network who has "
        "the printed address can watch and drive.",
    )
    parser.add_argument(
        "--port", type=int, default=8080, help="Port of the page; if it is taken, the next free one; 0: any free one."
    )
    parser.add_argument("--no-open", action="store_true", help="Do not open a browser.")
