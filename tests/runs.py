"""Small real results for the tests of what comes after a run."""

import functools

import numpy as np

from cablesim import Case, simulate
from cablesim.starters import starter_text

CHANGES = {
    "sway": ("duration: 10 s", "duration: 1 s"),
    "tow": ("duration: 180 s", "duration: 30 s"),
    "buoys": ("duration: 60 s", "duration: 4 s"),
}


def short_case(kind):
    """Text of a starter with a short duration, and markers."""
    text = starter_text(kind, "case.yaml", kind).replace(*CHANGES[kind])
    return text + "  markers: {count: 5}\n"


@functools.cache
def _computed(kind):
    return simulate(Case.from_yaml(short_case(kind)))


def result(kind):
    """Result of a starter: sway (in space), tow (in a plane, one body), buoys (in space, two bodies)."""
    return _computed(kind).copy(deep=True)


def with_winch(dataset):
    """The same run seen as one with a winch: nodes beyond a moving outlet are on the drum.

    The last node is the outlet, the last segment the one that ends there.
    """
    s, time = dataset["s"].values, dataset["time"].values
    length = s[-1] * (0.93 + 0.04 * np.sin(time))
    drum = s >= length[:, None]
    outlet = np.stack(
        [
            [np.interp(x, s, column) for column in p.T]
            for x, p in zip(length, dataset["position"].values, strict=True)
        ]
    )
    for name in ("position", "velocity"):
        dataset[name].values[drum] = np.nan
    dataset["velocity"].values[:, -1] = 0.0
    dataset["position"].values[:, -1] = outlet
    at_outlet = dataset["tension"].values[:, -1].copy()
    dataset["tension"].values[drum[:, 1:]] = np.nan
    dataset["tension"].values[:, -1] = at_outlet
    dataset["deployed_length"] = ("time", length)
    dataset["payout_speed"] = ("time", s[-1] * 0.04 * np.cos(time))
    return dataset


def only(dataset, *names):
    """The same run as one whose case asks for these variables alone."""
    return dataset.drop_vars([name for name in dataset.data_vars if name not in names])


def with_imus(dataset, **places):
    """The same run with IMUs in the text of its case, name=place."""
    given = "".join(f"attachments:\n- {{kind: imu, name: {name}, at: {at}}}\n" for name, at in places.items())
    listed = given.replace("\nattachments:", "")
    dataset.attrs["case"] = dataset.attrs["case"].replace("attachments:\n", listed)
    return dataset
