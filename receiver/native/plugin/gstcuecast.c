/* cuecastkeys: a GStreamer element that hears a programme and writes its keys as timed text.
 *
 * In: sound, 32-bit floats, interleaved. Out: one text buffer for each key, timed when the hand
 * shows it on the programme's clock, usually sent ahead: phones, hand shape and placement, as in
 * "bɔ̃ 4 mouth". Between keys gap events keep what follows in step.
 * Specification: spec/bitstream.md (G4).
 *
 *     gst-launch-1.0 filesrc location=programme.mp4 ! decodebin ! audioconvert \
 *         ! cuecastkeys voice=voice.bin ! fdsink sync=true
 */
#include <gst/audio/audio.h>
#include <gst/gst.h>

#include "cuecast.h"

#define PACKAGE "cuecast"
#define GST_PACKAGE_ORIGIN "Unknown package origin"
#define CUECAST_KEYS(object) ((CuecastKeys *)(object))

enum { PROP_VOICE = 1 };

/* A hole or overlap of this length is a jump of the programme. */
static const GstClockTime JUMP = 40 * GST_MSECOND;

/* Symbols by number, G4. */
static const char *const PHONES[] = {
    "",  "a", "ɑ", "o", "œ", "ə", "i", "ɔ̃", "ɑ̃", "ɛ", "ɔ", "u", "ɛ̃", "ø", "e", "y", "œ̃", "p", "d",
    "ʒ", "k", "v", "z", "s", "ʁ", "b", "n", "ɥ", "m", "t", "f", "l", "ʃ", "ɲ", "w", "g", "j", "ŋ"};
static const char *const PLACEMENTS[] = {"rest", "side", "mouth", "chin", "cheek", "throat"};

typedef struct {
    GstElement parent;
    GstPad *sink, *src;
    gchar *voice_path;
    gchar *voice;          /* the file's bytes, from READY on */
    gsize voice_bytes;
    cue_state *cue;        /* NULL before caps */
    guint rate_hz, channels;
    GstClockTime expected; /* time of the next sample; none: the next one begins anew */
} CuecastKeys;

typedef struct {
    GstElementClass parent;
} CuecastKeysClass;

G_DEFINE_TYPE(CuecastKeys, cuecast_keys, GST_TYPE_ELEMENT)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS,
    GST_STATIC_CAPS("audio/x-raw, format=" GST_AUDIO_NE(F32) ", layout=interleaved, "
                    "rate=[22050, 96000], channels=[1, 8]"));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS("text/x-raw, format=utf8"));

/* Report the receiver's own words. */
static void complain(CuecastKeys *self, const char *what) {
    char text[512] = "";
    if (self->cue && cue_explain(self->cue, text, sizeof text) != CUE_OK) text[0] = 0;
    GST_ELEMENT_ERROR(self, STREAM, DECODE, ("%s", what), ("%s", text));
}

static GstFlowReturn push_key(CuecastKeys *self, double start_s, const cue_key *key) {
    const char *first = key->phones[0] < G_N_ELEMENTS(PHONES) ? PHONES[key->phones[0]] : "?";
    const char *second = key->phones[1] < G_N_ELEMENTS(PHONES) ? PHONES[key->phones[1]] : "?";
    const char *where = key->placement < G_N_ELEMENTS(PLACEMENTS) ? PLACEMENTS[key->placement] : "?";
    gchar *text = g_strdup_printf("%s%s %u %s\n", first, second, key->shape, where);
    GstBuffer *buffer = gst_buffer_new_wrapped(text, strlen(text));
    GST_BUFFER_PTS(buffer) = (GstClockTime)(MAX(start_s, 0) * GST_SECOND);
    GST_BUFFER_DURATION(buffer) = (GstClockTime)(key->duration_s * GST_SECOND);
    return gst_pad_push(self->src, buffer);
}

/* Push the keys that wait; `sent` is set if there were any. */
static GstFlowReturn push_waiting(CuecastKeys *self, gboolean *sent) {
    cue_event event = {.size = sizeof event};
    cue_status status;
    GstFlowReturn flow = GST_FLOW_OK;
    while (flow == GST_FLOW_OK && (status = cue_next(self->cue, &event)) == CUE_OK) {
        const cue_key *key = &event.of.key;
        if (event.kind != CUE_EVENT_KEY || !key->final || key->duration_s <= 0) continue;
        flow = push_key(self, event.time_s, key);
        *sent = TRUE;
    }
    return flow;
}

static GstFlowReturn chain(GstPad *pad, GstObject *parent, GstBuffer *buffer) {
    CuecastKeys *self = CUECAST_KEYS(parent);
    GstMapInfo map;
    GstFlowReturn flow = GST_FLOW_OK;
    gboolean sent = FALSE;
    (void)pad;
    if (!self->cue) {
        gst_buffer_unref(buffer);
        return GST_FLOW_NOT_NEGOTIATED;
    }
    GstClockTime pts = GST_BUFFER_PTS(buffer), now = self->expected;
    if (GST_CLOCK_TIME_IS_VALID(pts)) {
        gboolean known = GST_CLOCK_TIME_IS_VALID(now);
        GstClockTime apart = !known ? 0 : pts > now ? pts - now : now - pts;
        if (!known || apart > JUMP || GST_BUFFER_IS_DISCONT(buffer)) {
            if (cue_reset(self->cue, (double)pts / GST_SECOND) != CUE_OK) flow = GST_FLOW_ERROR;
            now = pts;
        }
    } else if (!GST_CLOCK_TIME_IS_VALID(now)) now = 0;
    if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) flow = GST_FLOW_ERROR;
    else {
        gsize frames = map.size / (sizeof(float) * self->channels);
        const float *samples = (const float *)(gconstpointer)map.data;
        GstClockTime lasts = gst_util_uint64_scale(frames, GST_SECOND, self->rate_hz);
        for (gsize at = 0; at < frames && flow == GST_FLOW_OK; at += self->rate_hz) {
            gsize count = MIN(frames - at, self->rate_hz);
            if (cue_push(self->cue, samples + at * self->channels, count) != CUE_OK) flow = GST_FLOW_ERROR;
            else flow = push_waiting(self, &sent);
        }
        gst_buffer_unmap(buffer, &map);
        if (flow == GST_FLOW_OK && !sent) gst_pad_push_event(self->src, gst_event_new_gap(now, lasts));
        self->expected = now + lasts;
    }
    if (flow == GST_FLOW_ERROR) complain(self, "The receiver refuses the sound.");
    gst_buffer_unref(buffer);
    return flow;
}

/* Make a receiver for the sound's rate and channels. */
static gboolean set_caps(CuecastKeys *self, GstCaps *caps) {
    GstAudioInfo info;
    if (!gst_audio_info_from_caps(&info, caps)) return FALSE;
    self->rate_hz = (guint)GST_AUDIO_INFO_RATE(&info);
    self->channels = (guint)GST_AUDIO_INFO_CHANNELS(&info);
    cue_config config = cue_default_config(self->rate_hz, self->channels);
    gsize bytes = cue_size(&config);
    g_free(self->cue);
    self->cue = bytes ? g_malloc(bytes) : NULL;
    self->expected = GST_CLOCK_TIME_NONE;
    if (!self->cue || cue_init(self->cue, bytes, &config) != CUE_OK) return FALSE;
    if (cue_voice(self->cue, self->voice, self->voice_bytes) != CUE_OK) {
        complain(self, "The voice is not one of this version.");
        return FALSE;
    }
    GstCaps *text = gst_static_pad_template_get_caps(&src_template);
    gboolean taken = gst_pad_push_event(self->src, gst_event_new_caps(text));
    gst_caps_unref(text);
    return taken;
}

static gboolean take_event(GstPad *pad, GstObject *parent, GstEvent *event) {
    CuecastKeys *self = CUECAST_KEYS(parent);
    gboolean sent = FALSE;
    switch (GST_EVENT_TYPE(event)) {
        case GST_EVENT_CAPS: {
            GstCaps *caps;
            gst_event_parse_caps(event, &caps);
            gboolean taken = set_caps(self, caps);
            gst_event_unref(event);
            return taken;
        }
        case GST_EVENT_EOS:
            if (self->cue && cue_flush(self->cue) == CUE_OK) push_waiting(self, &sent);
            break;
        case GST_EVENT_SEGMENT:
        case GST_EVENT_FLUSH_STOP: self->expected = GST_CLOCK_TIME_NONE; break;
        default: break;
    }
    return gst_pad_event_default(pad, parent, event);
}

static GstStateChangeReturn change_state(GstElement *element, GstStateChange change) {
    CuecastKeys *self = CUECAST_KEYS(element);
    GError *error = NULL;
    if (change == GST_STATE_CHANGE_NULL_TO_READY &&
        (!self->voice_path ||
         !g_file_get_contents(self->voice_path, &self->voice, &self->voice_bytes, &error))) {
        GST_ELEMENT_ERROR(self, RESOURCE, OPEN_READ, ("No voice: set voice=FILE."),
                          ("%s", error ? error->message : "cuecast voice export writes one"));
        g_clear_error(&error);
        return GST_STATE_CHANGE_FAILURE;
    }
    GstStateChangeReturn done =
        GST_ELEMENT_CLASS(cuecast_keys_parent_class)->change_state(element, change);
    if (change == GST_STATE_CHANGE_PAUSED_TO_READY) g_clear_pointer(&self->cue, g_free);
    if (change == GST_STATE_CHANGE_READY_TO_NULL) g_clear_pointer(&self->voice, g_free);
    return done;
}

static void set_property(GObject *object, guint id, const GValue *value, GParamSpec *spec) {
    CuecastKeys *self = CUECAST_KEYS(object);
    if (id != PROP_VOICE) {
        G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
        return;
    }
    g_free(self->voice_path);
    self->voice_path = g_value_dup_string(value);
}

static void get_property(GObject *object, guint id, GValue *value, GParamSpec *spec) {
    if (id == PROP_VOICE) g_value_set_string(value, CUECAST_KEYS(object)->voice_path);
    else G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static void finalize(GObject *object) {
    CuecastKeys *self = CUECAST_KEYS(object);
    g_free(self->voice_path);
    g_free(self->voice);
    g_free(self->cue);
    G_OBJECT_CLASS(cuecast_keys_parent_class)->finalize(object);
}

static void cuecast_keys_class_init(CuecastKeysClass *class) {
    GstElementClass *element = GST_ELEMENT_CLASS(class);
    GObjectClass *object = G_OBJECT_CLASS(class);
    object->set_property = set_property;
    object->get_property = get_property;
    object->finalize = finalize;
    element->change_state = change_state;
    g_object_class_install_property(
        object, PROP_VOICE,
        g_param_spec_string("voice", "Voice", "File that cuecast voice export wrote", NULL,
                            G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY));
    gst_element_class_add_static_pad_template(element, &sink_template);
    gst_element_class_add_static_pad_template(element, &src_template);
    gst_element_class_set_static_metadata(
        element, "Keys of a Cuecast programme", "Decoder/Subtitle/Audio",
        "Hears a virtual French Cued Speech interpreter in sound; writes her keys as text",
        "Cuecast");
}

static void cuecast_keys_init(CuecastKeys *self) {
    self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
    gst_pad_set_chain_function(self->sink, chain);
    gst_pad_set_event_function(self->sink, take_event);
    gst_element_add_pad(GST_ELEMENT(self), self->sink);
    self->src = gst_pad_new_from_static_template(&src_template, "src");
    gst_pad_use_fixed_caps(self->src);
    gst_element_add_pad(GST_ELEMENT(self), self->src);
    self->expected = GST_CLOCK_TIME_NONE;
}

static gboolean start(GstPlugin *plugin) {
    return gst_element_register(plugin, "cuecastkeys", GST_RANK_NONE, cuecast_keys_get_type());
}

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, cuecast, "Receiver of Cuecast", start,
                  "0.1", "Apache 2.0", "cuecast", GST_PACKAGE_ORIGIN)
