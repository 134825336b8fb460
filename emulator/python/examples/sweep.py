"""Many runs of a scenario on all cores, as a table."""

import sys

import siskin


def main(path: str, seeds: str = "12", csv: str | None = None) -> None:
    table = siskin.sweep(path, seeds=range(1, int(seeds) + 1))
    print(f"{table!r} with {len(table.columns)} columns, of which")
    for column in table.columns:
        values = table[column]
        if column.endswith(".angle_error_max_deg"):
            worst = values.argmax()
            print(f"{column}: {values[worst]:.2f} at worst, with seed {table[int(worst)]['seed']}")
    if csv is not None:
        table.to_csv(csv)


if __name__ == "__main__":
    main(*sys.argv[1:])
