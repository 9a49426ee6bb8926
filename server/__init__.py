"""The institution: studies, people, trials, pages.

A decision multiplies matrices of ten rows. numpy's BLAS would share even these among all cores, which costs
nine times the CPU and takes it from the other requests. So it gets one thread, said before numpy is imported;
processes are what shares the load.
"""

import os

os.putenv("OPENBLAS_NUM_THREADS", "1")
