"""Draws the pictures of docs/explanation/algebra.md from the library itself.

./irsbot python docs/pictures/draw_algebra.py            # writes docs/pictures/algebra_*.png
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from irsbot_kinematics import algebra
from irsbot_supervisor.plots.algebra.configurations import draw_configurations
from irsbot_supervisor.plots.algebra.paths import draw_path
from irsbot_supervisor.plots.algebra.slices import draw_cells, draw_side_by_side
from irsbot_supervisor.plots.algebra.surfaces import draw_surfaces

HERE = Path(__file__).parent


def smaller(path: Path, width: int = 1000) -> None:
    """Fewer pixels and 64 colours: a page loads faster."""
    image = Image.open(path).convert("RGB")
    image = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
    image.quantize(64, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """All pictures of the page."""
    rpr = algebra.predefined("3rpr")
    cells = algebra.decompose(rpr, ("rho2", "rho3"), ((0.1, 45), (0.1, 45)), {"rho1": 17})
    draw_cells(cells, rpr, HERE / "algebra_cells.png", algebra.cusps(rpr, {"rho1": 17}))
    six = algebra.configurations(rpr, {"rho1": 14.98, "rho2": 15.38, "rho3": 12})
    draw_configurations(rpr, six, HERE / "algebra_configurations.png")
    hybrid = algebra.predefined("hybridglide")
    joint = algebra.decompose(hybrid, ("rho1", "rho2"), ((0, 4), (0, 4)), {"rho3": 2})
    pose = algebra.decompose(hybrid, ("x", "y"), ((-2, 2), (-2, 6)), {"z": 1})
    draw_side_by_side(joint, pose, hybrid, HERE / "algebra_spaces.png")
    ortho = algebra.predefined("orthoglide")
    surface = algebra.project(ortho, "parallel", "joint")
    draw_surfaces(surface, ortho.joints, [(0, 4)] * 3, ortho, HERE / "algebra_surface.png", "orthoglide: Type 2")
    five_bar = algebra.predefined("five_bar")
    reach = algebra.decompose(five_bar, ("x", "z"), ((-1.5, 1.5), (-1.5, 1.5)))
    path = algebra.image_of_path(five_bar, [{"x": "-0.9", "z": "-0.3"}, {"x": 1, "z": "-0.6"}], reach, per_segment=60)
    draw_path(five_bar, path, HERE / "algebra_path.png", reach)
    for picture in HERE.glob("algebra_*.png"):
        smaller(picture)


if __name__ == "__main__":
    main()
