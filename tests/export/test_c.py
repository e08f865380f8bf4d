"""Exported C builds where it is put down, is what it was here, and meets nothing of anybody else's."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import mpmath
import numpy as np
import pytest
from exported import SECONDS, SOME, STRICT, commands, compare, reference, shell

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_module, load
from ncgen.exchange.export import export
from ncgen.exchange.export.package import renamed

# Prints every kernel of the exported model a little off its start, as tests of the emitted code do.
KERNELS = r"""
#include <stdio.h>
#include "@.h"
static @_ncgen_real q[1000], qd[1000], p[1000], out[2000];
#define SHOW(kernel, size, ...) \
    if (m->kernel && m->kernel(__VA_ARGS__, out)) return 1; \
    for (int i = 0; m->kernel && i < (size); ++i) printf(#kernel " %.17g\n", (double)out[i]);
int main(void)
{
    const @_ncgen_model *m = @_model();
    const @_ncgen_real t = 0.375;
    for (int i = 0; i < m->n_parameters; ++i) p[i] = m->default_parameters[i];
    for (int i = 0; i < m->n_coordinates; ++i) {
        q[i] = m->initial_position[i] + (i % 7 - 3) / 64.0;
        qd[i] = (i % 5 - 2) / 2.0;
    }
    SHOW(phi, m->n_rows, t, q, p)
    SHOW(phi_q, m->phi_q_pattern.indptr[m->n_rows], t, q, p)
    SHOW(nu, m->n_rows, t, q, p)
    SHOW(gamma, m->n_rows, t, q, qd, p)
    SHOW(mass, m->mass_pattern.indptr[m->n_coordinates], t, q, p)
    SHOW(force, m->n_coordinates, t, q, qd, p)
    SHOW(energy, 3, t, q, qd, p)
    SHOW(power, 1, t, q, qd, p)
    SHOW(constraints, 2 * m->n_rows + m->phi_q_pattern.indptr[m->n_rows], t, q, qd, p)
    return 0;
}
"""


@pytest.mark.parametrize("name", SOME)
def test_readme_builds_and_runs(fresh, name):
    """The README's first block, in a clean folder, prints our own motion."""
    folder = fresh(name)
    build, run = commands(folder / "README.md")[0]
    shell(build, folder)
    shell(run.replace("main >", f"main {SECONDS[name]} 11 >"), folder)
    compare(folder / "motion.csv", name, 1e-6)


@pytest.mark.parametrize("name", SOME)
def test_kernels_are_ours(built, name):
    """Every kernel of the built library gives what it gives in Python."""
    folder = built(name)
    (folder / "kernels.c").write_text(KERNELS.replace("@", name))
    shell(f"cc -std=c99 kernels.c -Iinclude lib{name}.a -lm -o kernels", folder)
    said = {}
    for line in shell("./kernels", folder).splitlines():
        said.setdefault(line.split()[0], []).append(float(line.split()[1]))
    kernels, _ = reference(name)
    i = np.arange(kernels.n)
    assert set(said) == set(kernels.programs.programs)
    for kernel, values in said.items():
        expected = kernels.values(kernel, 0.375, kernels.q0 + (i % 7 - 3) / 64, (i % 5 - 2) / 2.0, None)
        np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))


def test_cmake_commands_of_the_readme(fresh):
    folder = fresh("pendulum")
    for command in commands(folder / "README.md")[1]:
        shell(command.replace("main >", "main 1 11 >"), folder)
    compare(folder / "motion.csv", "pendulum", 1e-6)


CONSUMER = r"""
#include <stdio.h>
#include "pendulum_motion.h"
#include "fourbar_motion.h"
int main(void)
{
    pendulum_state a;
    fourbar_state b;
    int wrong = pendulum_start(&a, NULL) || fourbar_start(&b, NULL);
    for (int i = 0; i < 100; ++i)
        wrong = wrong || pendulum_step(&a, NULL, 1e-3) || fourbar_step(&b, NULL, 1e-3);
    printf("%.3f %.3f\n", a.t, b.t);
    return wrong;
}
"""


def test_two_mechanisms_in_one_cmake_project(exports, fresh, tmp_path):
    """One found by find_package, one added by add_subdirectory, both included in one file: the lines of docs/embedding.md."""
    pendulum, fourbar = fresh("pendulum"), fresh("fourbar")
    shell("cmake -B build -DBUILD_SHARED_LIBS=ON && cmake --build build && cmake --install build --prefix ../prefix", pendulum)
    consumer = tmp_path / "consumer"
    consumer.mkdir()
    (consumer / "consumer.c").write_text(CONSUMER)
    page = (Path(__file__).resolve().parents[2] / "docs" / "embedding.md").read_text(encoding="utf-8")
    (consumer / "CMakeLists.txt").write_text(re.search(r"```cmake\n(.*?)```", page, re.DOTALL)[1])
    (consumer / "fourbar").symlink_to(fourbar)
    shell(f"cmake -B build -DCMAKE_PREFIX_PATH={tmp_path / 'prefix'} && cmake --build build", consumer)
    assert shell("./build/consumer", consumer) == "0.100 0.100\n"


@pytest.mark.parametrize("number", ["", "SINGLE"])
def test_pkg_config_consumer(fresh, built, tmp_path, number):
    """What `make install` leaves is found by pkg-config, with the number type it was built for."""
    shell(f"make install PREFIX={tmp_path / 'prefix'} NUMBER={number}", (fresh if number else built)("pendulum"))
    text = CONSUMER.replace("fourbar", "pendulum").replace(
        "int main", f"int size[sizeof(pendulum_real) == {4 if number else 8} ? 1 : -1];\nint main"
    )
    (tmp_path / "consumer.c").write_text(text)
    found = {"PKG_CONFIG_PATH": str(tmp_path / "prefix/lib/pkgconfig")}
    shell("cc consumer.c $(pkg-config --cflags --libs pendulum) -o consumer", tmp_path, **found)
    assert shell("./consumer", tmp_path) == "0.100 0.100\n"


@pytest.mark.parametrize("number", ["", "SINGLE"])
@pytest.mark.parametrize("name", ["fourbar", pytest.param("disc", marks=pytest.mark.slow)])
def test_no_warning(fresh, name, number):
    shell(f"make CFLAGS='-O1 {STRICT}' NUMBER={number} main realtime", fresh(name))


@pytest.mark.parametrize("number, tolerance", [("SINGLE", 5e-3), ("LONG_DOUBLE", 1e-6), pytest.param("QUAD", 1e-6, marks=pytest.mark.slow)])
def test_other_number_types_move_alike(fresh, number, tolerance):
    folder = fresh("suspension")
    shell(f"make NUMBER={number} && ./main 0.5 11 > motion.csv", folder)
    compare(folder / "motion.csv", "suspension", tolerance)


@pytest.mark.parametrize("name", ["fourbar", "nfourbar"])
def test_names_begin_with_the_models(built, name):
    """Nothing that a linker could confuse with other people's: every symbol defined begins with the model's name."""
    folder = built(name)
    listed = shell(f"nm -g --defined-only lib{name}.a", folder)
    symbols = re.findall(r"^[0-9a-f]+ (\w) (\w+)$", listed, re.MULTILINE)
    assert len(symbols) >= 10
    assert [symbol for _, symbol in symbols if not symbol.startswith(f"{name}_")] == []
    assert {kind for kind, _ in symbols} <= {"T", "R"}


def test_macros_begin_with_the_models(exports, tmp_path):
    """The public headers define no macro and no type of another name."""
    include = exports("robot") / "include"
    (tmp_path / "all.c").write_text("".join(f'#include "{header.name}"\n' for header in sorted(include.glob("*.h"))))
    own = set(shell(f"cc -std=c99 -E -dM -I{include} all.c", tmp_path).splitlines())
    (tmp_path / "std.c").write_text("#include <stddef.h>\n")
    names = {line.split()[1] for line in own - set(shell("cc -std=c99 -E -dM std.c", tmp_path).splitlines())}
    assert names and [name for name in names if not name.startswith("ROBOT_")] == []


COMPILERS = {
    "float": f"cc -x c -std=c99 {STRICT} -DPENDULUM_NCGEN_SINGLE",
    "C++": "g++ -x c++ -std=c++20 -Wall -Wextra -Wconversion -Wpedantic -Wno-missing-field-initializers -Werror",
}


@pytest.mark.parametrize("language", COMPILERS)
def test_the_single_header_has_no_warning(exports, tmp_path, language):
    """The C library of an export, in float and in C++, as a compiler reads it."""
    (tmp_path / "all.c").write_text('#define PENDULUM_IMPLEMENTATION\n#include "pendulum_single.h"\n')
    shell(f"{COMPILERS[language]} -fsyntax-only -I{exports('pendulum') / 'single'} all.c", tmp_path)


def test_single_header(exports, tmp_path):
    """One header, included twice, in C and in C++, gives the same motion as the folder."""
    shutil.copy(exports("nfourbar") / "single/nfourbar_single.h", tmp_path)
    main = (exports("nfourbar") / "examples/main.c").read_text().replace("nfourbar_motion.h", "nfourbar_single.h")
    (tmp_path / "main.c").write_text('#define NFOURBAR_IMPLEMENTATION\n#include "nfourbar_single.h"\n' + main)
    shell(f"cc -std=c99 -O1 {STRICT} main.c -lm -o main && ./main 0.6 11 > motion.csv", tmp_path)
    compare(tmp_path / "motion.csv", "nfourbar", 1e-6)
    shutil.copy(tmp_path / "main.c", tmp_path / "main.cpp")
    flags = "-Wall -Wextra -Wconversion -Wpedantic -Wno-missing-field-initializers -Werror"
    shell(f"g++ -std=c++20 -O0 {flags} main.cpp -o main && ./main 0.6 11 > motion.csv", tmp_path)
    compare(tmp_path / "motion.csv", "nfourbar", 1e-6)


ZIG = f"{sys.executable} -m ziglang cc"


@pytest.mark.parametrize("compiler", ["clang", "tcc", pytest.param(ZIG, marks=pytest.mark.slow)], ids=["clang", "tcc", "zig"])
def test_other_compilers(fresh, compiler, tmp_path):
    there = find_spec("ziglang") if compiler == ZIG else shutil.which(compiler)
    if not there:
        pytest.skip(f"{compiler.split()[-2] if compiler == ZIG else compiler} is not installed")
    folder = fresh("suspension")
    flags = "-g0" if compiler == "tcc" else f"-O1 {STRICT}"
    shell(f"make CC='{compiler}' CFLAGS='{flags}' && ./main 0.5 11 > motion.csv", folder, ZIG_GLOBAL_CACHE_DIR=str(tmp_path))
    compare(folder / "motion.csv", "suspension", 1e-6)


@pytest.mark.skipif(not shutil.which("arm-none-eabi-gcc"), reason="arm-none-eabi-gcc is not installed")
@pytest.mark.parametrize("number", [pytest.param("", marks=pytest.mark.slow), "SINGLE"])
def test_arm_without_operating_system(fresh, number):
    """It compiles for a 32-bit ARM, and holds no writable data there."""
    folder = fresh("suspension")
    target = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"
    listed = shell(f"make CC='arm-none-eabi-gcc {target}' CFLAGS='-Os {STRICT}' NUMBER={number} sizes", folder)
    rows = [line.split() for line in listed.splitlines() if re.match(r"\s+\d", line)]
    assert len(rows) == len([*folder.glob("src/*.c")])
    assert all(int(text) > 0 and int(data) == int(bss) == 0 for text, data, bss, *_ in rows)


GUARDED = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@_motion.h"
#define GUARD 64
#define CANARY (-1.2345678e300)
int main(void)
{
    struct { double before[GUARD]; @_state state; double after[GUARD]; } s;
    double *p = malloc(@_N_P * sizeof *p + 1);
    int wrong = 0;
    for (int i = 0; i < GUARD; ++i) s.before[i] = s.after[i] = CANARY;
    @_defaults(p);
    wrong += @_start(&s.state, p) != 0;
    for (int i = 0; i < 20; ++i) wrong += @_step(&s.state, p, 1e-3) != 0;
    wrong += @_advance(&s.state, p, 0.1, 1e-8, 1e-10) != 0;
    for (int i = 0; i < GUARD; ++i)
        wrong += s.before[i] != CANARY || s.after[i] != CANARY;
    free(p);
    return wrong;
}
"""


@pytest.mark.parametrize("name", [pytest.param("pendulum", marks=pytest.mark.slow), *SOME[1:]])
def test_under_sanitizers(fresh, name):
    """Address and undefined-behaviour sanitizers and canaries around the state find nothing."""
    folder = fresh(name)
    (folder / "examples/main.c").write_text(GUARDED.replace("@_N_P", f"{name.upper()}_N_PARAMETERS").replace("@", name))
    shell("make CFLAGS='-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all' && ./main", folder)


STEPS = r"""
#include <stdio.h>
#include "@_motion.h"
int main(void)
{
    for (int n = FIRST; n <= 4 * FIRST; n *= 2) {
        @_state s, before;
        @_real p[100];
        @_defaults(p);
        if (@_start(&s, p)) return 1;
        for (int i = 0; i < n; ++i) if (@_step(&s, p, 0.25 / n)) return 2;
        for (int i = 0; i < @_N; ++i) printf("%.17g ", s.q[i]);
        printf("\n");
        before = s;
        if (@_step(&s, p, 1e8) == 0) return 3; /* no mechanism closes after this */
        if (s.t != before.t || s.q[0] != before.q[0] || s.qd[0] != before.qd[0]) return 4;
    }
    return 0;
}
"""


@pytest.mark.parametrize("name, steps", [("suspension", 256), ("nfourbar", 64)])
def test_fixed_steps_have_order_four(built, name, steps):
    """Errors at 0.25 s fall sixteenfold when the step is halved; a step that fails leaves the state."""
    folder = built(name)
    (folder / "examples/main.c").write_text(
        STEPS.replace("FIRST", str(steps)).replace("@_N", f"{name.upper()}_N_COORDINATES").replace("@", name)
    )
    ends = np.array([list(map(float, line.split())) for line in shell("make -s && ./main", folder).splitlines()])
    kernels, _ = reference(name)
    speeds = kernels.model.simulation_options.get("zd0")
    method = {"formalism": "coordinate-partitioning", "integrator": "dop853"}
    exact = ncgen.simulate(kernels, 0.25, rtol=1e-13, atol=1e-14, zd0=speeds, points=2, **method).q[-1]
    errors = np.linalg.norm(ends - exact, axis=1)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4.0, atol=0.1)


def test_through_singular_positions(built):
    """The N-four-bar keeps its branch through ten passes of its flat position: B0 against the closed form at 10 s.

    x = 2 sn cn of (t/2 | -4c), c = g (3/2 + 2)/(3/3 + 2) for N = 2 (tests/reference/nfourbar.csv).
    """
    folder = built("nfourbar")
    last = shell("make -s && ./main 10 2", folder).splitlines()[-1].split(",")
    m = -4 * mpmath.mpf("9.81") * mpmath.mpf("3.5") / 3
    sn, cn = (mpmath.ellipfun(kind, 5, m=m) for kind in ("sn", "cn"))
    assert float(last[1]) == pytest.approx(float((2 * sn * cn).real), abs=5e-5)
    assert float(last[2]) == pytest.approx(float((1 - 2 * sn**2).real), abs=5e-5)


def test_realtime_loop_runs(built):
    folder = built("pendulum")
    said = shell("make realtime && ./realtime 0.2", folder)
    assert "pendulum: 200 steps of 1 ms, 0 restarts" in said and "a step takes: median" in said


def test_same_bytes_twice(exports, tmp_path):
    export(load("fourbar"), "c", tmp_path)
    for file in sorted(tmp_path.rglob("*.*")):
        if file.is_file():
            assert file.read_bytes() == (exports("fourbar") / file.relative_to(tmp_path)).read_bytes()


def test_refusals():
    """What has no export is refused in one line with its reason."""
    with pytest.raises(ModelError, match="--to cobol.*choose one of c"):
        export(load("pendulum"), "cobol", "unused")
    calling = example_module("pendulum").build()
    calling.callbacks.append(lambda t, q, qd, kernels: 0 * q)
    with pytest.raises(ModelError, match="pendulum cannot be exported: it calls a Python function"):
        export(calling, "c", "unused")
    massless = ncgen.Model("ghost")
    massless.distance(massless.point("A", (0, 0), fixed=True), massless.point("B", (1, 0)))
    with pytest.raises(ModelError, match="ghost cannot be exported: nothing has mass"):
        export(massless, "c", "unused")


def test_command_line(tmp_path):
    command = [sys.executable, "-m", "ncgen", "export", "pendulum", "--to", "c", "-o", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert all((tmp_path / line).is_file() for line in done.stdout.split())


def test_renaming():
    text = 'int ncgen_run(ncgen_real x); /* by ncgen. */ #include "ncgen.h" NCGEN_OK my_ncgen_x'
    assert renamed(text, "arm") == 'int arm_ncgen_run(arm_ncgen_real x); /* by ncgen. */ #include "arm_ncgen.h" ARM_NCGEN_OK my_ncgen_x'
