#!/usr/bin/python3
"""The tanks of varve_throughput in PySPH: 120 x 60 or 24 x 24 x 24 particles of fluid under a free
surface, the same kernel (Wendland C2, called WendlandQuintic there), support 2.5 dx, sound speed and
step, one force evaluation per step (PECIntegrator), one thread. Prints million particle updates per
CPU-second. Usage: pysph_tank.py STEPS [2|3]"""
import sys
import time

import numpy as np
from compyle.config import get_config

get_config().use_openmp = False

from pysph.base.kernels import WendlandQuintic
from pysph.base.nnps import LinkedListNNPS
from pysph.base.utils import get_particle_array_wcsph
from pysph.sph.integrator import PECIntegrator
from pysph.sph.scheme import WCSPHScheme

steps = int(sys.argv[1])
dim = int(sys.argv[2]) if len(sys.argv) > 2 else 2
columns, rows, above = (120, 60, 30) if dim == 2 else (24, 24, 12)
layers, dx = 3, 1e-3
h, sound_speed, dt = 1.25 * dx, 10.849, 0.25 * 1.25e-3 / 10.849
random = np.random.default_rng(1)


def particles(name, x):
    return get_particle_array_wcsph(name=name, m=np.full(x[0].size, 1000 * dx**dim),
                                    h=np.full(x[0].size, h), rho=np.full(x[0].size, 1000.0),
                                    **dict(zip("xyz", x)))


across, up = np.arange(-layers, columns + layers), np.arange(-layers, rows + above)
sites = [axis.ravel() for axis in np.meshgrid(*([across, up] if dim == 2 else [across, up, across]))]
inside = sites[1] >= 0
for axis in sites[::2]:
    inside &= (axis >= 0) & (axis < columns)
wet = inside & (sites[1] < rows)
jitter = random.uniform(-0.05 * dx, 0.05 * dx, (dim, int(wet.sum())))
fluid = particles("fluid", [(axis[wet] + 0.5) * dx + j for axis, j in zip(sites, jitter)])
walls = particles("walls", [(axis[~inside] + 0.5) * dx for axis in sites])

scheme = WCSPHScheme(["fluid"], ["walls"], dim=dim, rho0=1000.0, c0=sound_speed, h0=h, hdx=1.25,
                     gy=-9.81, nu=1e-5, alpha=0.0, beta=0.0, gamma=1.0)
kernel = WendlandQuintic(dim=dim)
scheme.configure_solver(kernel=kernel, integrator_cls=PECIntegrator, dt=dt, tf=1e9, pfreq=10**9,
                        adaptive_timestep=False, output_at_times=[])
scheme.setup_properties([fluid, walls], clean=False)
solver = scheme.get_solver()
search = LinkedListNNPS(dim=dim, particles=[fluid, walls], radius_scale=kernel.radius_scale,
                        fixed_h=True, cache=True)
solver.pm = None  # no MPI
solver.set_disable_output(True)
solver.set_print_freq(10**9)
solver.setup(particles=[fluid, walls], equations=scheme.get_equations(), nnps=search,
             kernel=kernel, fixed_h=True)
solver.max_steps = steps
start = time.process_time()
solver.solve(show_progress=False)
cpu = time.process_time() - start
if solver.count != steps or not np.isfinite(fluid.x).all():
    sys.exit("pysph_tank: the run did not do its steps, or blew up")
print(f"{1e-6 * int(wet.sum()) * steps / cpu:.3f}")
