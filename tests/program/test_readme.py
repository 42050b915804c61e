# SPDX-License-Identifier: MIT
"""The README's firmware example, and the generated model it uses."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import Run, call

from blw.build import ROOT

MODEL = "pendulum_physical"
FLAGS = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-O2"]
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[+-]?\d+)?")

#: The plant at rest but for a push, the example in the loop, and an angle sensor that lies.
DRIVER = """
#include <math.h>
#include <stdio.h>
int main(void)
{
    blw_real_t x[4] = {0}, force = 0;
    const blw_plant_t *const p = &blw_pendulum_physical_plant;
    bool trusted = true;
    x[2] = BLW_R(0.02);
    if (!control_init()) { return 1; }
    for (int k = 1; k <= 200; k++) {
        blw_real_t next[4], y[4], lie = (k > 50) ? BLW_R(1.0) : BLW_R(0.0);
        for (int i = 0; i < 4; i++) {
            next[i] = p->Bu[i] * force;
            for (int j = 0; j < 4; j++) { next[i] += p->A[i * 4 + j] * x[j]; }
        }
        for (int i = 0; i < 4; i++) { x[i] = next[i]; }
        y[0] = y[1] = y[2] = x[0];
        y[3] = x[2] + lie;
        if (k == 20) { y[1] = (blw_real_t)NAN; }
        trusted = control_step(force, y, &force);
        if (fabs((double)x[2]) > 0.7) { return 2; }
        if ((k == 40) && !trusted) { return 3; }
    }
    return trusted ? 4 : 0;
}
"""


def test_example_keeps_the_pendulum_up_and_names_the_liar(tmp_path: Path) -> None:
    (example,) = re.findall(r"```c\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    source, program = tmp_path / "main.c", tmp_path / "main"
    source.write_text(example + DRIVER)
    library = sorted((ROOT / "lib" / "src").glob("*.c"))
    built = call([shutil.which("gcc") or "cc", *FLAGS, f"-I{ROOT}/lib/include",
                  f"-I{ROOT}/lib/models", source, ROOT / f"lib/models/{MODEL}_model.c", *library,
                  "-lm", "-o", program])
    assert built.returncode == 0, built.stderr
    assert call([program]).returncode == 0


@pytest.mark.parametrize("suffix", ["h", "c"])
def test_committed_model_is_what_the_design_tool_writes(
    tmp_path: Path, bulwark: Run, suffix: str
) -> None:
    """Text to the letter; numbers to what another linear-algebra library may round differently."""
    done = bulwark("design", ROOT / f"host_sim/models/{MODEL}.toml", "--out", tmp_path,
                   "--method", "kalman", "--method", "canonical")
    assert done.returncode == 0, done.stderr
    made, kept = (re.sub(r"0x[0-9A-Fa-f]+", "CRC", (folder / f"{MODEL}_model.{suffix}").read_text())
                  for folder in (tmp_path, ROOT / "lib" / "models"))
    assert "".join(NUMBER.sub("", made).split()) == "".join(NUMBER.sub("", kept).split())
    np.testing.assert_allclose(*(np.array(NUMBER.findall(text), float) for text in (made, kept)),
                               rtol=1e-6, atol=1e-9)
