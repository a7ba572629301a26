#include "tools/view_page.h"

#include <cstddef>
#include <span>

#include <nlohmann/json.hpp>

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char letters[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = (three << 8) | (k < left ? bytes[i + k] : std::uint8_t{0});
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= left ? letters[(three >> (18 - 6 * k)) & 63] : '=';
  }
  return text;
}

/// Little endian, whatever the machine: typed arrays of browsers are.
template <class T>
std::string packed(const std::vector<T>& values) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(values.size() * sizeof(T));
  for (const T value : values)
    for (std::size_t k = 0; k < sizeof(T); ++k)
      bytes.push_back(static_cast<std::uint8_t>(value >> (8 * k)));
  return base64(bytes);
}

Json cloud_json(const ViewCloud& cloud) {
  return {{"place", packed(cloud.place)}, {"speed", packed(cloud.speed)}};
}

Json scene_json(const ViewScene& scene) {
  Json object{{"name", scene.name},
              {"title", scene.title},
              {"dimension", scene.dimension},
              {"pipe", scene.pipe},
              {"open_top", scene.open_top},
              {"height_m", scene.height},
              {"lower_m", scene.lower},
              {"upper_m", scene.upper},
              {"grain_speed_m_s", scene.grain_speed},
              {"fluid_speed_m_s", scene.fluid_speed},
              {"radii_m", scene.radii},
              {"spacing_m", scene.spacing},
              {"fluid_shown_one_in", scene.fluid_shown_one_in}};
  object["facts"] = Json::array();
  for (const auto& [key, value] : scene.facts) object["facts"].push_back({key, value});
  object["states"] = Json::array();
  for (const ViewState& state : scene.states)
    object["states"].push_back({{"step", std::to_string(state.step)},
                                {"time_s", state.time},
                                {"left_m", state.left},
                                {"width_m", state.width},
                                {"settling_speed_m_s", state.settling_speed},
                                {"grains", cloud_json(state.grains)},
                                {"fluid", cloud_json(state.fluid)},
                                {"id", packed(state.id)},
                                {"species", packed(state.species)}});
  return object;
}

constexpr const char* head = R"html(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>varve view</title>
<style>
body{font:14px/1.4 system-ui,sans-serif;margin:12px;color:#222;background:#fafafa}
#runs{display:flex;flex-wrap:wrap;gap:18px}
figure{margin:0}figcaption{max-width:420px}figcaption b{font-size:15px}
canvas{display:block;background:#fff;border:1px solid #ccc}
.facts{color:#666;font-size:12px}
#bar{position:sticky;top:0;background:#fafafa;padding:6px 0;display:flex;gap:10px;
align-items:center;flex-wrap:wrap}
#slider{flex:1;min-width:200px}
output{font-variant-numeric:tabular-nums;min-width:11em}
@media(prefers-color-scheme:dark){body,#bar{background:#181818;color:#ddd}
canvas{background:#222;border-color:#444}.facts{color:#999}}
</style></head><body>
<div id="bar"><button id="play">Play</button>
<input id="slider" type="range" min="0" value="0" aria-label="time"><output id="now"></output>
<label>grains by <select id="by"><option>speed<option>id<option>species</select></label>
<label id="plane_label">plane <select id="plane"><option value="0,1">x y
<option value="2,1">z y<option value="0,2">x z</select></label>
<label><input id="fluid" type="checkbox" checked> fluid</label></div>
<div id="runs"></div><script id="data" type="application/json">)html";

constexpr const char* tail = R"html(</script><script>
'use strict';
const data=JSON.parse(document.getElementById('data').textContent);
const $=id=>document.getElementById(id);
function bytes(text){const raw=atob(text),b=new Uint8Array(raw.length);
for(let i=0;i<raw.length;i++)b[i]=raw.charCodeAt(i);return b;}
function words(text,size){const b=bytes(text),n=b.length/size,out=new Array(n);
for(let i=0;i<n;i++){let v=0;for(let k=size-1;k>=0;k--)v=v*256+b[i*size+k];out[i]=v;}return out;}
function cloud(c){return{place:words(c.place,2),speed:bytes(c.speed)};}
for(const run of data)for(const s of run.states){s.grains=cloud(s.grains);s.fluid=cloud(s.fluid);
s.id=words(s.id,4);s.species=bytes(s.species);}
// Blue (slow) over green to yellow (fast), readable without telling red from green.
function heat(t){return`hsl(${250-195*t} ${60+30*t}% ${38+20*t}%)`;}
const times=[...new Set(data.flatMap(r=>r.states.map(s=>s.time_s)))].sort((a,b)=>a-b);
$('slider').max=times.length-1;
if(!data.some(r=>r.dimension===3))$('plane_label').hidden=true;
const tallest=Math.max(...data.map(r=>r.upper_m[1]-r.lower_m[1]));
const panels=data.map(run=>{
 const figure=document.createElement('figure'),canvas=document.createElement('canvas'),
  curve=document.createElement('canvas'),caption=document.createElement('figcaption');
 const name=document.createElement('b');name.textContent=run.name;
 const facts=document.createElement('div');facts.className='facts';
 facts.textContent=[run.title,...run.facts.map(f=>f.join(' '))].filter(t=>t).join(' · ')+
  (run.fluid_shown_one_in>1?` · one fluid particle in ${run.fluid_shown_one_in} shown`:'');
 const hover=document.createElement('div');hover.className='facts';hover.textContent='\u00a0';
 caption.append(name,facts);figure.append(caption,canvas,curve,hover);$('runs').append(figure);
 const panel={run,canvas,curve,hover,seen:[]};
 canvas.addEventListener('mousemove',e=>{const r=canvas.getBoundingClientRect();
  const x=e.clientX-r.left,y=e.clientY-r.top,found=panel.seen.find(g=>Math.hypot(g.x-x,g.y-y)<=g.r);
  hover.textContent=found?`grain ${found.id}: ${found.text}`:'\u00a0';});
 curve.addEventListener('click',e=>{const r=curve.getBoundingClientRect();
  const t=times[0]+(e.clientX-r.left)/r.width*(times[times.length-1]-times[0]);
  let best=0;times.forEach((u,k)=>{if(Math.abs(u-t)<Math.abs(times[best]-t))best=k;});
  $('slider').value=best;draw();});
 return panel;});
function stateAt(run,time){let found=null;
 for(const s of run.states)if(s.time_s<=time+1e-12)found=s;return found;}
function drawPanel(p,time){
 const run=p.run,[a,b]=run.dimension===3?$('plane').value.split(',').map(Number):[0,1];
 const scale=Math.min(520/tallest,720/(run.upper_m[a]-run.lower_m[a]));
 const w=(run.upper_m[a]-run.lower_m[a])*scale+8,h=(run.upper_m[b]-run.lower_m[b])*scale+8;
 const ratio=window.devicePixelRatio||1,c=p.canvas;
 c.width=w*ratio;c.height=h*ratio;c.style.width=w+'px';c.style.height=h+'px';
 const g=c.getContext('2d');g.scale(ratio,ratio);p.seen=[];
 const s=stateAt(run,time);if(!s){g.fillText('not yet',8,16);return;}
 const d=run.dimension,span=k=>(run.upper_m[k]-run.lower_m[k])/65535;
 const px=(v,i)=>4+v[i*d+a]*span(a)*scale,py=(v,i)=>h-4-v[i*d+b]*span(b)*scale;
 if($('fluid').checked){const r=Math.max(1,run.spacing_m*scale*0.8),n=s.fluid.speed.length;
  for(let i=0;i<n;i++){g.fillStyle=`hsl(205 60% ${92-50*s.fluid.speed[i]/255}%)`;
   g.fillRect(px(s.fluid.place,i)-r/2,py(s.fluid.place,i)-r/2,r,r);}}
 const across=x=>4+(x-run.lower_m[0])*scale,up=y=>h-4-(y-run.lower_m[1])*scale;
 if(a===0&&b===1){g.strokeStyle='#888';g.beginPath();
  g.moveTo(across(s.left_m),up(run.height_m));g.lineTo(across(s.left_m),up(0));
  g.lineTo(across(s.left_m+s.width_m),up(0));g.lineTo(across(s.left_m+s.width_m),up(run.height_m));
  if(!run.open_top)g.closePath();g.stroke();}
 const by=$('by').value,v=s.grains;
 for(let i=0;i<s.id.length;i++){const r=run.radii_m[s.species[i]||0]*scale;
  g.fillStyle=by==='speed'?heat(v.speed[i]/255):
   by==='id'?`hsl(${s.id[i]*137.5%360} 60% 50%)`:`hsl(${30+s.species[i]*90} 65% 50%)`;
  g.beginPath();g.arc(px(v.place,i),py(v.place,i),r,0,7);g.fill();
  g.strokeStyle='#0006';g.stroke();
  const at=[];for(let k=0;k<d;k++)at.push((run.lower_m[k]+v.place[i*d+k]*span(k)).toPrecision(4));
  p.seen.push({x:px(v.place,i),y:py(v.place,i),r,id:s.id[i],text:`at ${at.join(', ')} m, `+
   `${(v.speed[i]/255*run.grain_speed_m_s).toPrecision(2)} m/s`});}
 drawCurve(p,time,w,ratio);}
const fastest=Math.max(...data.flatMap(r=>r.states.map(s=>s.settling_speed_m_s)),0);
const slowest=Math.min(...data.flatMap(r=>r.states.map(s=>s.settling_speed_m_s)),0);
function drawCurve(p,time,w,ratio){
 const c=p.curve,h=70,states=p.run.states;c.width=w*ratio;c.height=h*ratio;
 c.style.width=w+'px';c.style.height=h+'px';
 const g=c.getContext('2d');g.scale(ratio,ratio);
 if(!states.some(s=>s.id.length)){c.hidden=true;return;}
 const t0=times[0],t1=times[times.length-1],range=fastest-slowest||1;
 const x=t=>t1>t0?(t-t0)/(t1-t0)*w:0,y=u=>h-4-(u-slowest)/range*(h-8);
 g.strokeStyle='#888';g.beginPath();g.moveTo(0,y(0));g.lineTo(w,y(0));g.stroke();
 g.strokeStyle='#1f6fb2';g.beginPath();
 states.forEach((s,k)=>g[k?'lineTo':'moveTo'](x(s.time_s),y(s.settling_speed_m_s)));g.stroke();
 g.strokeStyle='#c60';g.beginPath();g.moveTo(x(time),0);g.lineTo(x(time),h);g.stroke();
 g.fillStyle='#888';g.fillText(`mean settling speed, up to ${fastest.toPrecision(3)} m/s`,4,12);}
function draw(){const time=times[+$('slider').value];
 const steps=data.map(r=>stateAt(r,time)).map(s=>s?s.step:'-').join(', ');
 $('now').textContent=`t = ${+time.toPrecision(6)} s, step ${steps}`;
 for(const p of panels)drawPanel(p,time);}
let timer=null;
$('play').addEventListener('click',()=>{if(timer){clearInterval(timer);timer=null;
 $('play').textContent='Play';return;}
 $('play').textContent='Pause';timer=setInterval(()=>{
 $('slider').value=(+$('slider').value+1)%times.length;draw();},60);});
for(const id of['slider','by','plane','fluid'])$(id).addEventListener('input',draw);
draw();
</script></body></html>
)html";

}  // namespace

std::string view_page(const std::vector<ViewScene>& scenes) {
  Json all = Json::array();
  for (const ViewScene& scene : scenes) all.push_back(scene_json(scene));
  // "<" could end the script element that holds the data; invalid UTF-8 becomes U+FFFD.
  const std::string plain = all.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string page = head;
  page.reserve(plain.size() + 16384);
  for (const char c : plain) {
    if (c == '<') page += "\\u003c";
    else page += c;
  }
  return page + tail;
}

}  // namespace varve::tools
