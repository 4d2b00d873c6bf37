from glob import glob

from setuptools import find_packages, setup

package = "irsbot_kinematics"

setup(
    name=package,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={package: ["py.typed", "presets/*.yaml", "stiffness/presets/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        (f"share/{package}/launch", glob("launch/*.launch.py")),
    ],
    install_requires=["setuptools", "numpy", "scipy", "pyyaml"],
    extras_require={
        "algebra": ["python-flint"],
        "test": ["pytest"],  # by which `colcon test` knows what to run
    },
    zip_safe=False,
    maintainer="irsbot maintainers",
    maintainer_email="maintainers@irsbot.example",
    description="Kinematics, singularity margins and statics of parallel robots.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["kinematics_node = irsbot_kinematics.nodes.executable:kinematics"]},
)
