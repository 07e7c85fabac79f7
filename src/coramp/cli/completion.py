"""What a shell may complete: names of strategies and of what is built in."""


def scenario_names(incomplete: str) -> list[str]:
    """Returns the built-in scenarios that begin so."""
    return _beginning("scenarios", incomplete)


def study_names(incomplete: str) -> list[str]:
    """Returns the built-in studies that begin so."""
    return _beginning("studies", incomplete)


def snapshot_names(incomplete: str) -> list[str]:
    """Returns the built-in snapshots that begin so."""
    return _beginning("snapshots", incomplete)


def strategy_names(incomplete: str) -> list[str]:
    """Returns the strategies that begin so, those of installed packages too."""
    from coramp.strategies.registry import strategies

    return [name for name in strategies() if name.startswith(incomplete)]


def _beginning(kind: str, incomplete: str) -> list[str]:
    from coramp.scenarios.toml_files import builtin_names

    return [name for name in builtin_names(kind) if name.startswith(incomplete)]
