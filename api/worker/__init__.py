"""The worker: leases jobs and carries each out with one `mpirun`."""
