#!/usr/bin/python3
"""The tank of varve_throughput in PySPH: 120 x 60 particles of fluid under a free surface, the same
kernel (Wendland C2, called WendlandQuintic there), support 2.5 dx, sound speed and step, one force
evaluation per step (PECIntegrator), one thread. Prints million particle updates per CPU-second.
Usage: pysph_tank.py STEPS"""
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
columns, rows, layers, dx = 120, 60, 3, 1e-3
h, sound_speed, dt = 1.25 * dx, 10.849, 0.25 * 1.25e-3 / 10.849
random = np.random.default_rng(1)


def particles(name, x, y):
    return get_particle_array_wcsph(name=name, x=x, y=y, m=np.full(x.size, 1000 * dx * dx),
                                    h=np.full(x.size, h), rho=np.full(x.size, 1000.0))


i, j = np.meshgrid(np.arange(-layers, columns + layers), np.arange(-layers, rows + 30))
x, y = ((i + 0.5) * dx).ravel(), ((j + 0.5) * dx).ravel()
inside = (i.ravel() >= 0) & (i.ravel() < columns) & (j.ravel() >= 0)
wet = inside & (j.ravel() < rows)
jitter = random.uniform(-0.05 * dx, 0.05 * dx, (2, int(wet.sum())))
fluid = particles("fluid", x[wet] + jitter[0], y[wet] + jitter[1])
walls = particles("walls", x[~inside], y[~inside])

scheme = WCSPHScheme(["fluid"], ["walls"], dim=2, rho0=1000.0, c0=sound_speed, h0=h, hdx=1.25,
                     gy=-9.81, nu=1e-5, alpha=0.0, beta=0.0, gamma=1.0)
kernel = WendlandQuintic(dim=2)
scheme.configure_solver(kernel=kernel, integrator_cls=PECIntegrator, dt=dt, tf=1e9, pfreq=10**9,
                        adaptive_timestep=False, output_at_times=[])
scheme.setup_properties([fluid, walls], clean=False)
solver = scheme.get_solver()
search = LinkedListNNPS(dim=2, particles=[fluid, walls], radius_scale=kernel.radius_scale,
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
print(f"{1e-6 * columns * rows * steps / cpu:.3f}")
