"""Why a vehicle was planned as it was."""
