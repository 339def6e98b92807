% What the MATLAB class gets of two raw streams and the finger, in Octave; prints a line of JSON.
%
% Run by bench/websocket.py; the same as measure.ts of the TypeScript client.
addpath(fullfile(fileparts(mfilename('fullpath')), '..', 'clients', 'matlab'));

function ms = age_ms(of)
  % Age of the newest sample or state when `read` returned.
  since_s = double(of.sample(end) - of.sample(1)) / of.sample_rate_hz;
  ms = 1e3 * (time() - double(of.utc_ns) / 1e9 - since_s);
end

function three = quantiles_of(ages)
  ages = sort(ages);
  last = numel(ages) - 1;
  three = round(100 * ages(1 + floor([0.5 0.99 1] * last))) / 100;
end

seconds = str2double(getenv('FRICTUS_SECONDS'));
f = frictus('127.0.0.1', str2double(getenv('FRICTUS_PORT')));
f.watch('rig1', {'force', 'accel'});
f.read(1.0);  % all have begun
counts = zeros(1, 4);  % samples, lost; states, lost
ages = {[], []};
began = tic();
began_s = cputime();
while toc(began) < seconds
  got = f.read(0.01);
  for name = intersect(fieldnames(got)', {'force', 'accel', 'finger'})
    of = got.(name{1});
    kind = 1 + strcmp(name{1}, 'finger');
    counts(2 * kind - 1) += numel(of.sample);
    counts(2 * kind) += of.lost;
    ages{kind}(end + 1) = age_ms(of);
  end
end
disp(jsonencode(struct('seconds', seconds, 'samples', counts(1), 'lostSamples', counts(2), ...
  'states', counts(3), 'lostStates', counts(4), 'age_samples_ms', quantiles_of(ages{1}), ...
  'age_finger_ms', quantiles_of(ages{2}), ...
  'cpu_percent', round(1e3 * (cputime() - began_s) / toc(began)) / 10)));
f.close();
