"""The worker: leases jobs and has a launcher, such as `mpirun`, carry each out."""
