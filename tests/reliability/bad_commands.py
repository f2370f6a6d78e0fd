"""Command lines with values that are none, options that contradict each other, and places that cannot be written to."""

from typing import Any

from rows import RUN, Row
from scenes import SOLID, changed

DAM = ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "out")

NEW_MESH = changed(SOLID, ("obstacles", 3, "scale"), 0.37)
"""A scene with a mesh that no other row has read, or it would be known still."""


def command(what: str, args: tuple[str, ...], *words: str, **more: Any) -> Row:
    return Row("command line", what, args, words, **more)


def options(*args: str) -> tuple[str, ...]:
    return (*DAM, *args)


def missing(package: str, extra: str, args: tuple[str, ...], *remedies: str, **more: Any) -> Row:
    """A command that needs a package which is not installed."""
    words = (package.replace("_", "-"), f"pip install 'taichi_rts[{extra}]'", *remedies)
    return command(f"{package} not installed: {args[0]} {args[-1]}", args, *words, hidden=package, **more)


NUMBERS = ("--courant", "--alpha", "--lambda-f", "--spacing", "--end-time", "--export-fps", "--checkpoint-every")
BAD_NUMBERS = {
    "wrong type": "many",
    "NaN": "nan",
    "infinite": "inf",
    "negative": "-1",
    "zero": "0",
    "huge": "1e300",
    "tiny": "1e-300",
}
VALID_OPTIONS = {("--checkpoint-every", "huge"), ("--export-fps", "tiny")}
"""A checkpoint, or a frame, at the end only."""

COMMANDS = [
    *(
        command(f"{option} {kind}", options("--stepper", "regional", option, value), option.strip("-").split("-")[0])
        for option in NUMBERS
        for kind, value in BAD_NUMBERS.items()
        if (option, kind) not in VALID_OPTIONS
    ),
    *(
        command(f"--sound-speed {kind}", options("--sound-speed", value), "sound")
        for kind, value in BAD_NUMBERS.items()
    ),
    *(
        command(f"{option} {value}", options(option, value), option.strip("-"))
        for option in ("--azimuth", "--elevation")
        for value in ("many", "nan", "inf", "1e300", "-400")
    ),
    *(
        command(f"{option} {value}", options(option, value), "picture" if value[-1].isdigit() else option)
        for option in ("--width", "--height")
        for value in ("many", "nan", "0", "-5", "100000")
    ),
    *(
        command(f"--levels {value}", options("--levels", value), "levels")
        for value in ("0", "-1", "1.5", "many", "100000")
    ),
    command("--particles many", options("--particles", "many"), "many", "30k"),
    command(
        "more particles than memory",
        options("--particles", "500M", "--precision", "f64"),
        "of memory",
        "are free",
        "use a spacing of at least",
    ),
    command("λ of 50", options("--courant", "50"), "courant", "less than or equal to 2", "50"),
    command(
        "levels of no power of two", options("--stepper", "asynchronous", "--levels", "6"), "levels 6", "use 4 or 8"
    ),
    command("--stagger -1", options("--stepper", "asynchronous", "--stagger", "-1"), "stagger"),
    command("--stagger 1e10", options("--stepper", "asynchronous", "--stagger", "10000000000"), "stagger"),
    *(
        command(f"{option} of another stepper", options("--stepper", "uniform", option, value), option, "uniform")
        for option, value in (("--levels", "3"), ("--stagger", "1"), ("--limiter", "True"))
    ),
    command(
        "panels and levels",
        options("--panels", "figure3", "--levels", "3"),
        "--panels figure3",
        "--levels",
        "leave out",
    ),
    command(
        "panels and a stepper",
        options("--panels", "steppers", "--stepper", "uniform"),
        "--panels steppers",
        "leave out",
    ),
    command(
        "spacing and particles",
        options("--spacing", "0.1", "--particles", "1k"),
        "particles '1k' and spacing 0.1 are both given; give one",
    ),
    command("one pixel", options("--width", "1"), "1 x 720"),
    command("spacing larger than a block", options("--spacing", "2"), "exceeds the shortest edge"),
    command("end before a frame", options("--export-fps", "1e7"), "export_fps"),
    command(
        "too many frames", options("--end-time", "2", "--export-fps", "1e6"), "frames", "use an export_fps of at most"
    ),
    command("too many checkpoints", options("--checkpoint-every", "1e-9"), "checkpoints", "use at least"),
    command(
        "unknown scene", ("run", "no_such_scene"), "'no_such_scene' is unknown; choose one of dam_break, dam_break_2d"
    ),
    command("missing scene file", ("run", "none.toml"), "none.toml' cannot be read: No such file", "check the path"),
    command("scene file that is a folder", ("run", "folder.toml"), "folder.toml", "check the path"),
    command("unknown extension", ("run", "scene.yaml"), "scene.yaml", "name a .toml file"),
    command("unknown option", options("--nonsense"), "nonsense"),
    command("unknown command", ("jump",), "jump"),
    command("unknown stepper", options("--stepper", "leapfrog"), "leapfrog"),
    command("unknown arch", options("--arch", "tpu"), "tpu"),
    command("arch missing", ("run", "dam_break_2d", "--arch", "cuda", "--output-dir", "out"), "cuda", "use --arch cpu"),
    command("unknown precision", options("--precision", "f16"), "f16"),
    command("eye without target", options("--eye", "1", "1", "5"), "--eye and --target go together"),
    command(
        "eye and azimuth",
        options("--eye", "1", "1", "5", "--target", "1", "1", "0", "--azimuth", "3"),
        "leave out these or those",
    ),
    command("zoom 0", options("--zoom", "0"), "--zoom 0 must be above 0"),
    command("angle of view", options("--fov", "200"), "200", "1 to 170"),
    command("unknown colours", options("--colour-by", "age"), "age", "lead"),
    command("unknown format", options("--export", "vtk"), "'vtk' is no format", "did you mean 'vtu'"),
    command("unknown attribute", options("--export", "vtu", "--attributes", "mood"), "'mood' is no attribute"),
    command(
        "misspelt attribute",
        options("--export", "vtu", "--attributes", "presure"),
        "'presure'",
        "did you mean 'pressure'",
    ),
    command("attributes of nothing", options("--attributes", "id"), "--attributes", "--export", "nothing is exported"),
    command(
        "surface in two dimensions",
        options("--export", "surface"),
        "surface needs a scene in 3 dimensions",
        "leave it out",
    ),
    command("video without pictures", options("--no-frames", "--video"), "--no-frames", "leave out one"),
    command("film without pictures", options("--no-frames", "--gif"), "--no-frames", "--gif"),
    command(
        "files of several runs", options("--panels", "steppers", "--export", "ply"), "--export", "one run", "--panels"
    ),
    command("window and debug", options("--gui", "--debug"), "--gui", "leave out --debug, or"),
    command(
        "window and views",
        options("--gui", "--views", "top", "--quality", "best"),
        "leave out --views, --quality, or",
    ),
    command(
        "window and no pictures",
        options("--gui", "--transparent", "--no-frames"),
        "leave out --no-frames, --transparent, or",
    ),
    command(
        "output exists",
        ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "earlier"),
        "already holds a run",
        "--overwrite",
    ),
    command(
        "output is a file",
        ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "drops.csv"),
        "is a file",
        "choose another",
    ),
    command(
        "output below a file",
        ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "drops.csv/out"),
        "drops.csv",
        "choose another",
    ),
    command(
        "no write permission",
        ("run", "dam_break_2d", "--arch", "cpu", "--output-dir", "/proc/out"),
        "/proc/out",
        "choose another",
    ),
    command("resume of nothing", ("run", "--resume", "none.npz"), "none.npz", "check the path"),
    command("resume of another file", ("run", "--resume", "drops.csv"), "drops.csv", "use another checkpoint"),
    command(
        "resume of a folder without checkpoints",
        ("run", "--resume", "earlier"),
        "no whole checkpoint",
        "start the run again",
    ),
    command(
        "compare: no such stepper",
        ("compare", "--steppers", "regionl", "--output-dir", "out"),
        "regionl",
        "did you mean regional",
    ),
    command("compare: no such key", ("compare", "--set", "alpa=0.1", "--output-dir", "out"), "did you mean alpha"),
    command("compare: levels", ("compare", "--levels", "2,x", "--output-dir", "out"), "levels", "x"),
    command("compare: no such error", ("compare", "--error", "colour", "--output-dir", "out"), "colour", "velocities"),
    command("compare: courants", ("compare", "--courants", "0.4,many", "--output-dir", "out"), "--courants", "many"),
    command(
        "compare: resume and overwrite",
        ("compare", "--resume", "--overwrite", "--output-dir", "out"),
        "--resume",
        "--overwrite",
    ),
    command("compare: courant NaN", ("compare", "--courants", "nan", "--output-dir", "out"), "nan"),
    command("compare: 0 samples", ("compare", "--samples", "0", "--output-dir", "out"), "samples"),
    command("compare: 0 repeats", ("compare", "--repeats", "0", "--output-dir", "out"), "repeats"),
    command("compare: 0 workers", ("compare", "--workers", "0", "--output-dir", "out"), "workers"),
    command("compare: end NaN", ("compare", "--end-time", "nan", "--output-dir", "out"), "end_time"),
    command("compare: output is a file", ("compare", "--output-dir", "drops.csv"), "is a file", "choose another"),
    command(
        "stability: no such case",
        ("stability", "--cases", "pistn", "--output-dir", "out"),
        "'pistn'",
        "did you mean 'piston'",
        "known",
    ),
    command("plot: no run", ("plot",), "no run to draw"),
    command("plot: no series", ("plot", "earlier"), "holds no series.csv"),
    command("plot: unknown ending", ("plot", "earlier", "--output", "curves.jpg"), "curves.jpg", ".png, .pdf, .svg"),
    command(
        "stability: no such stepper",
        ("stability", "--steppers", "rk4", "--output-dir", "out"),
        "'rk4'",
        "asynchronous-integers",
    ),
    command("stability: tolerance 0", ("stability", "--tolerance", "0", "--output-dir", "out"), "tolerance 0", "0.001"),
    command(
        "stability: resume and overwrite",
        ("stability", "--resume", "--overwrite", "--output-dir", "out"),
        "--resume",
        "--overwrite",
    ),
    command("stability: unknown arch", ("stability", "--arch", "tpu", "--output-dir", "out"), "tpu"),
    command(
        "bench: no such part",
        ("bench", "--rows", "peer", "speed"),
        "--rows speed: no such part of the table; choose any of peer, second",
    ),
    command("bench: scale 0", ("bench", "--scale", "0"), "--scale 0: must be above 0 and at most 4"),
    command("bench: 0 repeats", ("bench", "--repeats", "0"), "--repeats 0: must be 1 to 100"),
    command("stability: tolerance NaN", ("stability", "--tolerance", "nan", "--output-dir", "out"), "tolerance"),
    command("stability: 0 workers", ("stability", "--workers", "0", "--output-dir", "out"), "workers"),
    command("stability: output is a file", ("stability", "--output-dir", "drops.csv"), "is a file", "choose another"),
    missing("imageio_ffmpeg", "video", options("--video")),
    missing("h5py", "hdf", options("--export", "vtkhdf")),
    missing(
        "pysplashsurf", "surface", ("run", "dam_break", "--arch", "cpu", "--output-dir", "out", "--export", "surface")
    ),
    missing("trimesh", "mesh", RUN, scene=NEW_MESH),
    missing("matplotlib", "plots", ("compare", "--output-dir", "out")),
    missing("matplotlib", "plots", ("stability", "--output-dir", "out"), "--no-plot"),
    missing("distributed", "cluster", ("compare", "--output-dir", "out", "--no-plot", "--dask", "local")),
]
