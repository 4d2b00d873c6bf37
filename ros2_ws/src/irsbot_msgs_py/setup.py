from setuptools import find_packages, setup

package = "irsbot_msgs_py"

setup(
    name=package,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={package: ["py.typed", "process/*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},  # by which `colcon test` knows what to run
    zip_safe=False,
    maintainer="irsbot maintainers",
    maintainer_email="maintainers@irsbot.example",
    description="Python records of the irsbot messages, and their conversion to and from irsbot_msgs.",
    license="Apache-2.0",
)
