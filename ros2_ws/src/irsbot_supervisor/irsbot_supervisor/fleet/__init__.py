"""Many bags judged at the same time, on one machine or several, by Dask. Only `cluster` knows Dask."""
