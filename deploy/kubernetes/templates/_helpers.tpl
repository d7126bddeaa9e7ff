{{/* The release's name, as the first part of all names. */}}
{{- define "plateau.name" -}}
{{- if contains .Chart.Name .Release.Name -}}
{{- .Release.Name | trunc 40 | trimSuffix "-" -}}
{{- else -}}
{{- printf "%s-%s" .Release.Name .Chart.Name | trunc 40 | trimSuffix "-" -}}
{{- end -}}
{{- end -}}

{{/* By which pods are found; a dict of root and part. */}}
{{- define "plateau.selector" -}}
app.kubernetes.io/name: {{ .root.Chart.Name }}
app.kubernetes.io/instance: {{ .root.Release.Name }}
app.kubernetes.io/component: {{ .part }}
{{- end -}}

{{- define "plateau.labels" -}}
{{ include "plateau.selector" . }}
app.kubernetes.io/version: {{ .root.Chart.AppVersion | quote }}
app.kubernetes.io/managed-by: {{ .root.Release.Service }}
helm.sh/chart: {{ printf "%s-%s" .root.Chart.Name .root.Chart.Version }}
{{- end -}}

{{- define "plateau.image" -}}
{{- printf "%s/%s:%s" .root.Values.image.repository .program (.root.Values.image.tag | default .root.Chart.AppVersion) -}}
{{- end -}}

{{- define "plateau.redisSecret" -}}
{{- .Values.redis.existingSecret | default (printf "%s-redis" (include "plateau.name" .)) -}}
{{- end -}}

{{- define "plateau.keysSecret" -}}
{{- .Values.keys.existingSecret | default (printf "%s-keys" (include "plateau.name" .)) -}}
{{- end -}}

{{/* What every pod has: nobody's rights, and no account in the cluster. */}}
{{- define "plateau.pod" -}}
automountServiceAccountToken: false
enableServiceLinks: false
securityContext:
  runAsNonRoot: true
  runAsUser: {{ .uid | default 10001 }}
  runAsGroup: {{ .uid | default 10001 }}
  fsGroup: {{ .uid | default 10001 }}
  fsGroupChangePolicy: OnRootMismatch
  seccompProfile: {type: RuntimeDefault}
{{- with .root.Values.image.pullSecrets }}
imagePullSecrets:
  {{- range . }}
  - name: {{ . }}
  {{- end }}
{{- end }}
{{- end -}}

{{- define "plateau.container" -}}
securityContext:
  allowPrivilegeEscalation: false
  readOnlyRootFilesystem: true
  capabilities: {drop: [ALL]}
{{- end -}}

{{/* Environment of every process of the farm; a dict of root, its user of Redis, and
settings beside the common ones. */}}
{{- define "plateau.env" -}}
- name: PLATEAU_REDIS_URL
  valueFrom:
    secretKeyRef: {name: {{ include "plateau.redisSecret" .root }}, key: {{ .user }}-url}
{{- $s3 := .root.Values.blobs.s3 }}
{{- if $s3.url }}
- name: PLATEAU_BLOBS
  value: {{ $s3.url | quote }}
{{- $secret := required "blobs.s3.existingSecret: name the Secret with AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY" $s3.existingSecret }}
{{- if eq .user "worker" }}
{{- $secret = $s3.workerSecret | default $secret }}
{{- end }}
{{- range $name := list "AWS_ACCESS_KEY_ID" "AWS_SECRET_ACCESS_KEY" }}
- name: {{ $name }}
  valueFrom:
    secretKeyRef: {name: {{ $secret }}, key: {{ $name }}}
{{- end }}
- name: AWS_REGION
  value: {{ $s3.region | quote }}
{{- with $s3.endpoint }}
- name: AWS_ENDPOINT_URL
  value: {{ . | quote }}
{{- end }}
{{- if $s3.allowHttp }}
- name: AWS_ALLOW_HTTP
  value: "true"
{{- end }}
{{- else }}
- name: PLATEAU_BLOBS
  value: /var/lib/plateau/blobs
{{- end }}
- name: PLATEAU_CACHE
  value: /var/cache/plateau
{{- $settings := mergeOverwrite (dict) .root.Values.settings (.settings | default dict) }}
{{- if has .user (list "api" "worker") }}
{{- $roots := list }}
{{- range $name, $root := .root.Values.sceneRoots }}
{{- $roots = append $roots (printf "%s=%s" $name (prepend ($root.elsewhere | default list) (printf "/scenes/%s" $name) | join "|")) }}
{{- end }}
{{- with $roots }}
{{- $_ := set $settings "PLATEAU_SCENE_ROOTS" (join "," .) }}
{{- end }}
{{- end }}
{{- if and .root.Values.notify.existingSecret (has .user (list "api" "monitor")) }}
{{- $_ := set $settings "PLATEAU_NOTIFY_FILE" "/etc/plateau/notify/targets" }}
{{- end }}
{{- range $name := keys $settings | sortAlpha }}
- name: {{ $name }}
  value: {{ index $settings $name | toString | quote }}
{{- end }}
{{- end -}}

{{/* Where a process may write, as its root filesystem is read-only; and the blobs. */}}
{{- define "plateau.mounts" -}}
- {name: cache, mountPath: /var/cache/plateau}
- {name: tmp, mountPath: /tmp}
{{- if not .Values.blobs.s3.url }}
- {name: blobs, mountPath: /var/lib/plateau/blobs}
{{- end }}
{{- end -}}

{{/* The file of notifications' targets, for the API and the monitors. */}}
{{- define "plateau.notifyMounts" -}}
{{- if .Values.notify.existingSecret }}
- {name: notify, mountPath: /etc/plateau/notify, readOnly: true}
{{- end }}
{{- end -}}

{{- define "plateau.notifyVolumes" -}}
{{- with .Values.notify.existingSecret }}
- name: notify
  secret: {secretName: {{ . }}, defaultMode: 0440, items: [{key: targets, path: targets}]}
{{- end }}
{{- end -}}

{{/* Scenes where they lie, for the API and the workers. */}}
{{- define "plateau.sceneMounts" -}}
{{- range $name := keys .Values.sceneRoots | sortAlpha }}
- {name: scene-{{ $name }}, mountPath: /scenes/{{ $name }}, readOnly: true}
{{- end }}
{{- end -}}

{{- define "plateau.sceneVolumes" -}}
{{- range $name, $root := .Values.sceneRoots }}
- name: scene-{{ $name }}
  persistentVolumeClaim: {claimName: {{ $root.claim }}, readOnly: true}
{{- end }}
{{- end -}}

{{- define "plateau.volumes" -}}
- name: cache
  emptyDir: {sizeLimit: {{ .cacheSize }}}
- name: tmp
  emptyDir: {sizeLimit: 1Gi}
{{- if not .root.Values.blobs.s3.url }}
- name: blobs
  persistentVolumeClaim:
    claimName: {{ .root.Values.blobs.volume.existingClaim | default (printf "%s-blobs" (include "plateau.name" .root)) }}
{{- end }}
{{- end -}}

{{/* Each failure of a probe is an event, so the one of the start waits; a process that is started
again has removed the file of the one before by then. */}}
{{- define "plateau.startupProbe" -}}
startupProbe:
  exec: {command: [bash, -c, {{ printf "until %s; do sleep 1; done 2>/dev/null" .until | quote }}]}
  initialDelaySeconds: 5
  periodSeconds: 10
  timeoutSeconds: 150
  failureThreshold: 2
{{- end -}}

{{/* Of a process without HTTP: a file that it touches at each heartbeat, every 5 s, and that says why
it takes no work. */}}
{{- define "plateau.aliveProbes" -}}
{{- $fresh := "test $(( $(date +%s) - $(stat -c %Y /tmp/alive) )) -lt 60" }}
{{- include "plateau.startupProbe" (dict "until" "test -e /tmp/alive") }}
livenessProbe:
  exec: {command: [sh, -c, {{ $fresh | quote }}]}
  periodSeconds: 20
  timeoutSeconds: 5
  failureThreshold: 3
readinessProbe:
  exec: {command: [sh, -c, {{ printf "cat /tmp/alive; %s && test ! -s /tmp/alive" $fresh | quote }}]}
  periodSeconds: 20
  timeoutSeconds: 5
{{- end -}}

{{/* Spread the pods of a part over nodes, where that is possible. */}}
{{- define "plateau.spread" -}}
topologySpreadConstraints:
  - maxSkew: 1
    topologyKey: kubernetes.io/hostname
    whenUnsatisfiable: ScheduleAnyway
    labelSelector:
      matchLabels:
        {{- include "plateau.selector" . | nindent 8 }}
{{- end -}}

{{- define "plateau.placement" -}}
{{- with .nodeSelector }}
nodeSelector:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .tolerations }}
tolerations:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .affinity }}
affinity:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- end -}}

{{/* A way out to addresses that are not the cluster's; a dict of to (CIDRs) and port. */}}
{{- define "plateau.outside" -}}
- to:
    {{- range .to | default (list "0.0.0.0/0" "::/0") }}
    - ipBlock: {cidr: {{ . | quote }}}
    {{- end }}
  ports:
    - {protocol: TCP, port: {{ .port }}}
{{- end -}}

{{/* All addresses that are not private. */}}
{{- define "plateau.public" -}}
- ipBlock:
    cidr: 0.0.0.0/0
    except: [0.0.0.0/8, 10.0.0.0/8, 100.64.0.0/10, 127.0.0.0/8, 169.254.0.0/16, 172.16.0.0/12, 192.168.0.0/16]
- ipBlock:
    cidr: ::/0
    except: ["::1/128", "fc00::/7", "fe80::/10"]
{{- end -}}
