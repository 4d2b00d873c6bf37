"""Design files and records: what cannot be built is refused in one line that says what would be right."""

from __future__ import annotations

from importlib import resources
from math import nan, radians

import numpy as np
import pytest
import yaml

from irsbot_kinematics import stiffness
from irsbot_kinematics.stiffness import InvalidDesign, Material, Tube

ALUMINIUM = Material(70e9, 0.33, 2700.0)


def preset(name="irsbot2_table2"):
    folder = resources.files("irsbot_kinematics").joinpath("stiffness/presets")
    return yaml.safe_load(folder.joinpath(f"{name}.yaml").read_text(encoding="utf-8"))


@pytest.fixture
def load(tmp_path):
    def run(stated, **changes):
        path = tmp_path / "mine.yaml"
        path.write_text(stated if isinstance(stated, str) else yaml.safe_dump(stated))
        return stiffness.load(path, **changes)

    return run


@pytest.mark.parametrize(
    ("numbers", "stated"),
    [
        ((0.05, 0.06, 1.0, ALUMINIUM), "inner < outer diameter, got 0.06 against 0.05 m"),
        ((0.05, 0.05, 1.0, ALUMINIUM), "inner < outer"),  # zero thickness
        ((0.05, -0.01, 1.0, ALUMINIUM), "inner diameter >= 0"),
        ((0.05, nan, 1.0, ALUMINIUM), "inner must be finite"),
        ((0.0, 0.0, 1.0, ALUMINIUM), "outer diameter > 0"),
        ((nan, 0.0, 1.0, ALUMINIUM), "outer must be finite"),
        ((0.05, 0.0, 0.0, ALUMINIUM), "length > 0"),
        ((0.05, 0.0, nan, ALUMINIUM), "length must be finite"),
        ((0.05, 0.0, 1e300, ALUMINIUM), "length must be a number of at most"),
        ((1e300, 0.0, 1.0, ALUMINIUM), "outer must be a number of at most"),
        ((1e-300, 0.0, 1.0, ALUMINIUM), "second moment > 0"),
        ((0.05, 0.0, 1.0, "wood"), "no material 'wood'; known are aluminium"),
        ((0.05, 0.0, 1.0, 70e9), "needs a Material"),
    ],
)
def test_a_tube_that_cannot_be_built_is_refused(numbers, stated):
    with pytest.raises(InvalidDesign, match=stated):
        Tube(*numbers)


@pytest.mark.parametrize(
    ("numbers", "stated"),
    [
        ((-70e9, 0.33, 2700.0), "young > 0 Pa, got -7e\\+10"),
        ((0.0, 0.33, 2700.0), "young > 0"),
        ((nan, 0.33, 2700.0), "young must be finite"),
        ((70e9, 0.51, 2700.0), "poisson <= 0.5"),
        ((70e9, -1.0, 2700.0), "-1 < poisson"),
        ((70e9, 0.33, 0.0), "density > 0"),
    ],
)
def test_a_material_that_does_not_exist_is_refused(numbers, stated):
    with pytest.raises(InvalidDesign, match=stated):
        Material(*numbers)


def edited(*path, value=None, name="irsbot2_table2"):
    """A preset with one entry replaced, or left out for None."""
    stated = preset(name)
    at = stated
    for key in path[:-1]:
        at = at[key]
    if value is None:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return stated


@pytest.mark.parametrize(
    ("stated", "refusal"),
    [
        (edited("sections", "distal", "outer", value=46), "sections.distal.outer has no unit: 46; write for example"),
        (edited("sections", "distal", "outer", value="46 inch"), "unit of length"),
        (edited("sections", "distal", "outer", value="44 mm"), "sections.distal: a tube needs inner < outer"),
        (edited("sections", "distal", "outer", value="wide"), "must be a number with a unit"),
        (edited("sections", "distal", "outer", value="nan mm"), "must be finite"),
        (edited("sections", "distal", "material", value="wood"), "sections.distal: no material 'wood'"),
        (edited("sections", "distal", "outer"), "sections.distal needs outer, inner, material"),
        (edited("sections", "distal"), "irsbot2 has the tubes proximal, parallel, distal, elbow"),
        (edited("sections", "distal", "rigid", value=True), "distal tubes of the family irsbot2 cannot be rigid"),
        (edited("sections", "elbow", "rigid", value="yes please"), "rigid must be true or false"),
        (edited("geometry", "l1"), "geometry lacks l1"),
        (edited("geometry", "l1", value={"value": "-1 m"}), "l1 > 0"),
        (edited("geometry", "l1", value={"value": 1.0}), "geometry.l1 has no unit"),
        (edited("geometry", "beta", value="45 m"), "unit of angle"),
        (edited("geometry", "parallelogram"), "geometry lacks parallelogram"),
        (edited("geometry", "parallelogram", value="0 m"), "parallelogram needs a side > 0"),
        (edited("geometry", "direction", value=[0, 0]), "direction of the parallelogram needs a length > 0"),
        (edited("geometry", "direction", value=1), r"geometry.direction must be \[x, z\]"),
        (edited("geometry", "spacing", value="-0.1 m"), "spacing must be >= 0"),
        (edited("geometry", "l9", value="1 m"), "no length 'l9'"),
        (edited("geometry", "l1", value={"vlaue": "0.5 m"}), "geometry.l1 needs a value"),
        (edited("geometry", "spacing", value={"source": "none"}), "geometry.spacing needs a value"),
        (edited("geometry", "direction", value={"valu": [1, 0]}), "geometry.direction needs a value"),
        (edited("geometry", "l1", value={"value": "1 m", "sorce": "S1"}), "may have source, assumed"),
        (edited("robot", value="a" * 300), "a{300}"),
        (edited("family", value="hexapod"), "a family, one of irsbot2, five_bar, chains"),
        (edited("colour", value="red"), "unknown key 'colour'"),
        (edited("robot", value="five_bar"), "robot 'five_bar' is a five_bar"),
        (edited("robot", value="nobody"), "no robot 'nobody'"),
        (edited("working_mode", value=5), r"working mode \(5,\) is not one of"),
        (edited("working_mode", value=[1, 2]), r"working mode \(1, 2\) is not one of"),
        (edited("materials", value={"mine": {"young": "-70 GPa", "poisson": 0.3, "density": "1 kg/m3"}}), "young > 0"),
        (
            edited("materials", value={"mine": {"young": "70", "poisson": 0.3, "density": "1 kg/m3"}}),
            "young has no unit",
        ),
        (edited("materials", value={"mine": {"young": "70 GPa"}}), "material 'mine' needs young, poisson, density"),
        (edited("geometry", "platform_joint", value="glue", name="five_bar_table1"), "platform_joint must be one of"),
        ("[1, 2", "not YAML"),
        ("- 1", "expected a mapping"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(load, stated, refusal):
    with pytest.raises(InvalidDesign, match=refusal) as refused:
        load(stated)
    assert "\n" not in str(refused.value)
    assert "mine.yaml" in str(refused.value)


def test_names_that_do_not_exist_are_refused(load):
    for run in (
        lambda: stiffness.load("irsbot3"),
        lambda: stiffness.load("nowhere.yaml"),
        lambda: stiffness.load("irsbot2_table2", gamma=1.0),
        lambda: stiffness.load("irsbot2_table2", rigid=("wing",)),
        lambda: stiffness.load("irsbot2_table2", rigid="elbow"),
        lambda: stiffness.load("irsbot2_table2", rigid=3),
        lambda: stiffness.load("irsbot2_table2", rigid=([],)),
        lambda: stiffness.load("irsbot2_table2", parallelogram="0.2"),
        lambda: stiffness.load("irsbot2_table2", spacing=None),
        lambda: stiffness.load("irsbot2_table2", spacing=nan),
        lambda: stiffness.load("irsbot2_table2", l1="0.3"),
        lambda: stiffness.load("irsbot2_table2", l1=None),
        lambda: stiffness.load("irsbot2_table2", direction=np.zeros((2, 2))),
        lambda: stiffness.load("irsbot2_table2", direction=None),
        lambda: stiffness.load("five_bar_table1", platform_joint=3),
    ):
        with pytest.raises(InvalidDesign):
            run()


def test_numbers_of_a_file_are_read_in_their_units(load):
    stated = preset()
    stated["geometry"]["l1"] = "375 mm"
    stated["geometry"]["beta"] = "0.7853981633974483 rad"
    stated["materials"] = {"mine": {"young": "70000 MPa", "poisson": "0.33 1", "density": "2.7 g/cm3"}}
    stated["sections"]["distal"]["material"] = "mine"
    design, shipped = load(stated), stiffness.load("irsbot2_table2")
    assert design.geometry == shipped.geometry
    mine, aluminium = design.sections["distal"].material, shipped.sections["distal"].material
    assert (mine.young, mine.poisson, mine.density) == pytest.approx(
        (aluminium.young, aluminium.poisson, aluminium.density), rel=1e-15
    )


def test_changes_may_be_numbers_of_numpy():
    changed = stiffness.load("irsbot2_table2", direction=np.array([1.0, 0.0]), spacing=np.float64(0.3), rigid=["elbow"])
    assert changed.direction == (1.0, 0.0)
    assert changed.spacing == 0.3
    assert changed.sections["elbow"].rigid


def test_the_geometry_can_be_that_of_a_robot(load):
    stated = preset()
    stated["geometry"] = {"parallelogram": "0.2 m", "beta": "20 deg"}
    stated["robot"] = "irsbot2"
    design = load(stated)
    assert design.geometry.beta == pytest.approx(radians(20.0))
    assert design.geometry.l1 == 0.375
    other = stiffness.load("irsbot2_table2", robot="irsbot2", e=0.01)
    assert other.geometry.beta == pytest.approx(radians(10.0))
    assert other.geometry.e == 0.01
    assert other.parallelogram == 0.2
