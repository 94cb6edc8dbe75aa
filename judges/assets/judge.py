"""Compares generated pictures and models, as `anyhit` reads them, with other readers.

Arguments: the program, a folder for the files, how many of each, and a seed.
"""

import sys

import models
import pictures
from program import Program

program, folder, count, seed = sys.argv[1:]
program = Program(program, folder)
failed = pictures.judge(program, int(count), seed) + models.judge(program, int(count), seed)
sys.exit(failed > 0)
