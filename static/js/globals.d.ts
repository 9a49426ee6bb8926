/** The parts of jsPsych 8 that hatlab uses. */
declare namespace jsPsychModule {
  const ParameterType: Record<"BOOL" | "STRING" | "INT" | "FLOAT" | "FUNCTION" | "OBJECT" | "COMPLEX", number>;
  function initJsPsych(options: Record<string, unknown>): JsPsych;
  interface JsPsych {
    run(timeline: object[]): Promise<void>;
    finishTrial(data: Record<string, unknown>): void;
    abortExperiment(message?: string): void;
  }
}

declare module "jspsych" {
  export import initJsPsych = jsPsychModule.initJsPsych;
  export import ParameterType = jsPsychModule.ParameterType;
  export import JsPsych = jsPsychModule.JsPsych;
}
