"""Writes scan.nc and edges.nc, which the tests read, with the library of Unidata: scan.py FOLDER

Dimensions, variables and attributes are those that GXSM itself writes. A count is 100 × line + column, line 0 at the top.
"""

import sys
from pathlib import Path

import netCDF4
import numpy as np

COLUMNS, ROWS = 5, 3


def write(path: Path, field: str, kind: str, label: str, alias: str, name: str, less: int, version: str, times: int = 1) -> None:
    with netCDF4.Dataset(path, "w", format=version) as file:
        lengths = {"time": times, "value": 1, "dimx": COLUMNS, "dimy": ROWS, "basename": len(name) + 1}
        for key, length in lengths.items():
            file.createDimension(key, length)
        image = file.createVariable(field, kind, ("time", "value", "dimy", "dimx"))
        image.setncatts({"ZLabel": label, "unit": alias, "ZSrcUnit": alias})
        line, column = np.mgrid[:ROWS, :COLUMNS]
        image[:] = np.stack([100 * line + column + 1000 * n for n in range(times)])[:, np.newaxis]
        dx, dy = 20.0, 30.0
        file.createVariable("dimx", "f4", ("dimx",))[:] = dx * (np.arange(COLUMNS) - (COLUMNS - 1) / 2)
        file.createVariable("dimy", "f4", ("dimy",))[:] = -dy * (np.arange(ROWS) - (ROWS - 1) / 2)
        numbers = {"rangex": dx * (COLUMNS - less), "rangey": dy * (ROWS - less), "dz": 0.25, "offsetx": 100.0, "offsety": -50.0, "alpha": 30.0}
        for key, value in numbers.items():
            variable = file.createVariable(key, "f8", ())
            variable[:] = value
            variable.setncatts({"var_unit": "Ang", "unit": alias if key == "dz" else "AA"})
        text = file.createVariable("basename", "S1", ("basename",))
        text[:] = netCDF4.stringtochar(np.array([name], f"S{len(name) + 1}"))[0]
        file.setncatts({"Creator": "gxsm4", "Version": "1.0"})


folder = Path(sys.argv[1])
write(folder / "scan.nc", "FloatField", "f4", "Z", "AA", "/home/user/a-b042-M-Xm-Topo.nc", 1, "NETCDF3_CLASSIC")
write(folder / "edges.nc", "H", "i2", "ADC1", "V", "unnamed.nc", 0, "NETCDF3_64BIT_OFFSET", 2)
