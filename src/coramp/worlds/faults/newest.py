"""Which message of a vehicle counts: the newest by its stamp, in whatever order they arrive."""

from coramp._kernel import FloatArray, kernel


@kernel
def newest(known: FloatArray, rows: FloatArray, stamp: int) -> FloatArray:
    """Returns the newest row of each vehicle by the column ``stamp``, after ``rows`` have arrived.

    ``known`` has a row a vehicle, nan where there is none yet. Rows begin with a vehicle's number
    and are in order of arrival. One that is as old as what is known changes nothing.
    """
    now = known.copy()
    for k in range(len(rows)):
        number = int(rows[k, 0])
        if not rows[k, stamp] <= now[number, stamp]:
            now[number] = rows[k]
    return now
