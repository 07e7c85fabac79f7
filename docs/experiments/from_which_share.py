"""Writes figure and tables of from-which-share-it-pays.md from a study: give its folder."""

import sys

from page_tables import write_page

if __name__ == "__main__":
    write_page(
        sys.argv[1],
        "from-which-share-it-pays.md",
        "penetration.png",
        lambda study: study.plot_penetration(),
    )
