"""What every group of a client's calls has."""

from plateau.client.transport import Transport


class Calls:
    """Calls over one transport; `plateau.client.Client` is made of such groups.

    Every method raises `ApiError` where the service answers with a problem, `Unreachable` where
    nothing answers for as long as the client is patient, and `NotPlateau` where what answers is
    something else. Other errors, and the problems to reckon with, are with the method.
    """

    _transport: Transport
