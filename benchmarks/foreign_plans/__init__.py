"""Plans of OMPL on MotionBenchMaker's problems, judged by samples and by the proof."""
