"""A scenario with its figures, and the same with a motor that differs from what the ESC believes."""

import sys

import siskin


def main(path: str) -> None:
    for factor in (0.8, 1.0, 1.2):
        outcome = siskin.scenario(path, {"bench.scale.R": factor})
        verdict = "held" if outcome.held else "failed"
        for name, figures in outcome.windows.items():
            print(f"R x {factor}: {name} at {figures['rpm_mean']:.1f} rpm, trace {outcome.trace_hash}: {verdict}")


if __name__ == "__main__":
    main(*sys.argv[1:])
