"""What agencies read of a run: tables over intervals, queues, levels of service, emissions."""
