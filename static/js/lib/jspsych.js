// @ts-check
// jsPsych as a module: its npm package ships a browser build that sets a global, and a module build with bare imports.
// The page loads vendor/jspsych/ first; the import map sends "jspsych" here.

const { initJsPsych, ParameterType } = globalThis.jsPsychModule;

export { initJsPsych, ParameterType };
