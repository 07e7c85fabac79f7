"""Writes figure and tables of a-world-that-fails.md from a study: give its folder."""

import sys

from page_tables import write_page

if __name__ == "__main__":
    write_page(
        sys.argv[1], "a-world-that-fails.md", "hostile.png", lambda study: study.plot_hostile()
    )
