"""Keeps what IDA says about a failed step off the standard output; its return code says the same.

Depends on: nothing of ours.

scikit-sundae gives every IDA object an error handler that calls `print`, and no option to leave it out.
SUNDIALS has a function that takes handlers away from one context, and so from nothing else in the process;
the context belongs to the C part of the binding's object.
"""

from __future__ import annotations

import ctypes

import sksundae._cy_ida as binding

_WORD = ctypes.sizeof(ctypes.c_void_p)
_FIELDS = object.__basicsize__ + _WORD  # behind the head of the object and its table of methods

# the extension knows where its own copy of SUNDIALS is
_clear_handlers = ctypes.CDLL(binding.__file__).SUNContext_ClearErrHandlers
_clear_handlers.argtypes, _clear_handlers.restype = [ctypes.c_void_p], ctypes.c_int


def silence(ida: binding.IDA) -> bool:
    """Take the binding's error handler from a solver that has been started.

    Parameters
    ----------
    ida : sksundae._cy_ida.IDA
        Its first two fields are the solver's memory, which begins with the address of the context, and
        the address of the context.  In a binding that is laid out in another way these differ: then
        nothing is done.

    Returns
    -------
    bool
        Whether it is silent now.
    """
    memory, context = (_pointer(id(ida) + _FIELDS + k * _WORD) for k in range(2))
    if not memory or not context or _pointer(memory) != context:
        return False
    return bool(_clear_handlers(context) == 0)


def _pointer(address: int) -> int | None:
    return ctypes.c_void_p.from_address(address).value
