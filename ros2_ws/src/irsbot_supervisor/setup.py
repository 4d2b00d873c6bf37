from glob import glob

from setuptools import find_packages, setup

package = "irsbot_supervisor"

setup(
    name=package,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={package: ["py.typed", "settings/*.yaml", "scenarios/*.yaml", "report/page/*", "fleet/*.j2"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        (f"share/{package}/launch", glob("launch/*.launch.py")),
        (f"share/{package}/policies", glob("policies/*.policy.xml")),
        (f"share/{package}/layouts", glob("layouts/*")),
    ],
    install_requires=[
        "setuptools",
        "numpy",
        "scipy",
        "pyyaml",
        "typer",
        "rich",
        "jinja2",
        "matplotlib",
        "mcap",
        "plotly",
        "polars",
        "distributed",
        "websockets",
        "orjson",
    ],
    extras_require={
        "foxglove": ["foxglove-sdk"],
        "pinocchio": ["pin"],  # which `bench` compares with
        "test": ["pytest"],  # by which `colcon test` knows what to run
    },
    zip_safe=False,
    maintainer="irsbot maintainers",
    maintainer_email="maintainers@irsbot.example",
    description="Singularity supervision of parallel robots: decision core, nodes, record and replay.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "supervisor_node = irsbot_supervisor.executables:supervisor",
            "simulated_joints_node = irsbot_supervisor.executables:simulated_joints",
            "recorder_node = irsbot_supervisor.executables:recorder",
            "suite_node = irsbot_supervisor.executables:suite",
            "irsbot = irsbot_supervisor.executables:irsbot",
        ]
    },
)
