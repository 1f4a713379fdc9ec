"""What `pyproject.toml` cannot say: the workflow, which lies at the top of a checkout, travels in the wheel."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

WORKFLOW = ("Snakefile", "workflow", "profiles", "config")
HOME = Path("stages", "command", "home")


class BuildWithWorkflow(build_py):
    """Copies the workflow beside the module that looks for it; an editable install has it at its place."""

    def run(self) -> None:
        """Build as ever, then copy."""
        super().run()
        if self.editable_mode:
            return
        home = Path(self.build_lib) / HOME
        shutil.rmtree(home, ignore_errors=True)
        for name in WORKFLOW:
            copy = shutil.copytree if Path(name).is_dir() else self.copy_file
            home.mkdir(parents=True, exist_ok=True)
            copy(name, str(home / name))


setup(cmdclass={"build_py": BuildWithWorkflow})
