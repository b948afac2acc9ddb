"""Commands on results: plot, report, animate, export, imu.

Depends on: application, terminal; what draws and writes, imported when a command needs it.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cablesim.cli.application import Force, ResultPath, command
from cablesim.cli.terminal import say

if TYPE_CHECKING:
    import xarray as xr

    from cablesim.files import Product


class Format(StrEnum):
    """What a result can be exported to."""

    CSV = "csv"
    VTK = "vtk"


class ImuFrame(StrEnum):
    """Local frames of the cable in which sensors can be mounted."""

    TRANSPORTED = "transported"
    PAPER = "paper"


class ImuErrorPreset(StrEnum):
    """Sensors whose errors are known."""

    NONE = "none"
    BMX160 = "bmx160"


@command
def plot(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture (png, pdf, svg); default: <result>.png")
    ] = None,
    force: Force = False,
) -> None:
    """Draw shapes, tensions and distances of a result."""
    from cablesim.files import replacing
    from cablesim.plot import plot_run

    output = Path(f"{result.stem}.png") if output is None else output
    product = _product(output, "plot", result, force=force, endings=(".png", ".pdf", ".svg"))
    figure = plot_run(_read_result(result))
    with replacing(output) as part:
        figure.savefig(part, metadata={"Creator": product.mark})
    say(f"{output} written")


@command
def report(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="HTML file; default: <result>.html")
    ] = None,
    force: Force = False,
) -> None:
    """Write a result as one HTML file: moving picture, lines against time, key numbers, case."""
    from cablesim.files import replacing
    from cablesim.report import write_report

    output = Path(f"{result.stem}.html") if output is None else output
    product = _product(output, "report", result, force=force, endings=(".html",))
    dataset = _read_result(result)
    with replacing(output) as part:
        write_report(dataset, part, generator=product.mark)
    say(f"{output} written ({output.stat().st_size / 1e6:.1f} MB); open it in a browser")


@command
def animate(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Film (mp4, gif); default: <result>.mp4")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Pictures per second of film; default 25, for a GIF 10.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second of film.")] = 1.0,
    force: Force = False,
) -> None:
    """Write a result as a film of the cable in space, with tensions and distances beside it."""
    from cablesim import animation
    from cablesim.files import replacing

    output = Path(f"{result.stem}.mp4") if output is None else output
    product = _product(output, "animate", result, force=force, endings=animation.FPS)
    dataset = _read_result(result)
    with replacing(output) as part:
        count = animation.animate(dataset, part, fps=fps, speed=speed, comment=product.mark)
    say(f"{output} written, {count} pictures")


@command
def export(
    result: ResultPath,
    format: Annotated[Format, typer.Option("--format", "-f", help="Tables, or polylines for ParaView.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; default: <result>_<format>, made if needed")
    ] = None,
    force: Force = False,
) -> None:
    """Write a result as tables (csv) or as polylines for ParaView (vtk)."""
    from cablesim.export import export_csv, export_vtk
    from cablesim.files import Product, check_folder

    folder = Path(f"{result.stem}_{format}") if output is None else output
    check_folder(folder)
    dataset = _read_result(result)
    product = Product.of(folder, "export", result, "--format", str(format))
    with product.filling(dataset.attrs, force=force) as part:
        files = export_csv(dataset, part) if format is Format.CSV else export_vtk(dataset, part, result.stem)
    what = (
        f"{files[0].name} and {len(files) - 1} more" if len(files) > 6 else ", ".join(f.name for f in files)
    )
    say(f"{folder}: {what} written")


@command
def imu(
    result: ResultPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File ending in .nc; default: <result>_imu.nc")
    ] = None,
    rate: Annotated[float, typer.Option("--rate", min=1e-3, help="Samples a second [Hz].")] = 100.0,
    frame: Annotated[
        ImuFrame, typer.Option("--frame", help="Frame of the cable: without twist, or the paper's.")
    ] = ImuFrame.TRANSPORTED,
    errors: Annotated[
        ImuErrorPreset, typer.Option("--errors", help="What the sensors do wrong.")
    ] = ImuErrorPreset.NONE,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the errors.")] = 0,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Folder for a table of each sensor too, made if needed")
    ] = None,
    force: Force = False,
) -> None:
    """Write what the IMUs of a result's case would read."""
    from cablesim.batch import write_result
    from cablesim.files import Product, check_folder
    from cablesim.sensors import export_imu_csv, imu_signals

    output = Path(f"{result.stem}_imu.nc") if output is None else output
    choices = {"--rate": f"{rate:g}", "--frame": frame, "--errors": errors, "--seed": str(seed)}
    options = [word for choice in choices.items() for word in choice]
    product = _product(output, "imu", result, *options, force=force, endings=(".nc",))
    if csv is not None:
        check_folder(csv)
    chosen = None if errors is ImuErrorPreset.NONE else str(errors)
    signals = imu_signals(_read_result(result), rate=rate, frame=str(frame), errors=chosen, seed=seed)
    write_result(signals, product)
    say(f"{output}: {signals.sizes['imu']} sensors, {signals.sizes['time']} samples written")
    if csv is not None:
        with Product.of(csv, "imu", result, *options).filling(signals.attrs, force=force) as part:
            files = export_imu_csv(signals, part)
        say(f"{csv}: {', '.join(file.name for file in files)} written")


def _product(
    output: Path, command: str, result: Path, *options: str, force: bool, endings: Iterable[str]
) -> Product:
    """Check that a command can write what it makes of a result, and nothing is lost by it."""
    from cablesim.files import Product, check_ending

    check_ending(output, endings)
    product = Product.of(output, command, result, *options)
    product.check({result: f"cablesim {command}"}, force=force)
    return product


def _read_result(path: Path) -> xr.Dataset:
    from cablesim.files import OutputError
    from cablesim.results import check_whole
    from cablesim.trajectory.file import read

    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise OutputError(f"{path} {what}. Name a result file, as `cablesim run` writes it.")
    try:
        dataset = read(path)
    except Exception as error:  # netCDF4 and xarray raise many kinds for a damaged file
        reason = getattr(error, "strerror", None) or str(error).partition("\n")[0]
        raise OutputError(f"{path} cannot be read as a result (netCDF): {reason}.") from None
    check_whole(dataset, OutputError)
    return dataset
