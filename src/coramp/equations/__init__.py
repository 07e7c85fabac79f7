"""The equations of Peng et al., numbered as there, with their errata mended (docs/errata.md)."""
